#pragma once
/// Static equilibrium under given conditions, stopped by a displacement error in mm that is checked.

#include "core/observer.hpp"
#include "tled/engine.hpp"
#include "tled/stiffness/rest_stiffness.hpp"

#include <string>

namespace tissuewarp::tled {

namespace detail {
class OneSidedContact;
class TangentFactor;
}  // namespace detail

enum class EquilibriumMethod {
    Automatic,
    Lbfgs,                  ///< limited-memory BFGS with the factor of K₀ as metric (Liu and Nocedal 1989)
    DynamicRelaxation,      ///< heavy ball with mass diag K₀ (Underwood 1983; Joldes, Wittek, Miller 2011)
    SelfCheckedRelaxation,  ///< the same, started and checked without the factor of K₀
    Newton,                 ///< with the tangent where the tissue is and forces in float64 (Nocedal and Wright 2006)
};

struct EquilibriumOptions {
    double tolerance_mm = 0.05;  ///< accepted largest nodal error, by the lifted residual ‖K₀⁻¹ r‖∞
    int max_steps = 4000;        ///< force evaluations
    int steps_per_check = 25;    ///< steps of dynamic relaxation recorded between two looks at the state
    EquilibriumMethod method = EquilibriumMethod::Automatic;
    EquilibriumMethod last = EquilibriumMethod::Newton;  ///< that Automatic escalates to: this or Lbfgs
    double known_highest = 0;         ///< EquilibriumResult::highest of a state and springs like these: self-checked
                                      ///< relaxation then goes without a search for it, unless it finds it wrong
    const RestState* rest = nullptr;  ///< that of the engine: lets L-BFGS factorise a metric near the answer for tissue
                                      ///< of which almost only the volume is stiff, and Newton's method decide
    detail::TangentFactor* tangent = nullptr;  ///< of that tissue at another state, which Newton's method begins with
    const detail::OneSidedContact* one_sided = nullptr;  ///< pushes too; Newton's method alone follows it
    bool on_the_way = false;  ///< a part of a load path: Newton's method need not know whether the tissue is stable
};

struct EquilibriumResult {
    Eigen::Matrix3Xd displacement;  ///< 3 × N, mm
    double estimated_error_mm = 0;  ///< by which it was accepted
    int force_evaluations = 0;
    int lifted_residuals = 0;  ///< triangular solves
    double min_jacobian = 1;
    double highest = 0;  ///< eigenvalue of diag(K)⁻¹K, a little more, as self-checked relaxation took it; 0 of others
    EquilibriumMethod method = EquilibriumMethod::Automatic;  ///< the one used
    std::string reason;                                       ///< why this one
};

/// Brings the engine to equilibrium under the conditions. Starts from the linear-elastic solution, or from `start`
/// (3 × N mm) plus the linear-elastic answer to its residual. Accepts by the lifted residual; soon after a linear
/// start, or with the history of L-BFGS, by a larger estimate (docs/decisions/equilibrium.md). Self-checked relaxation
/// starts from rest or `start` itself, unless that tears tissue, and accepts by how its movement contracts; it trusts
/// that the springs of `stiffness` hold the tissue about as those of `conditions` do. `Automatic` takes the method that
/// should be the fastest, then L-BFGS, then, with `rest` and without contact, Newton's, whose error is that of the
/// tangent; the engine is left where the answer is.
///
/// Throws InvalidInput for options or conditions that cannot be used, and SolverFailure, which names the cause, the
/// tetrahedron and the last good state: no admissible start, no progress, the precision of the engine reached, too many
/// evaluations, inverted tissue.
EquilibriumResult equilibrium(Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions,
                              const EquilibriumOptions& options = {}, const Eigen::Matrix3Xd* start = nullptr,
                              Observer& observer = silent_observer());

/// What equilibrium() found, judged by the tangent where the tissue is, with forces in float64, and brought to within
/// the tolerance by it; by Newton's method from there where K₀ does not prepare that or the tangent is not positive. As
/// it was found by a method that was asked for, without `rest`, on a GPU, by Newton's method, in contact and under
/// loads that follow the tissue. The engine is left where the answer is. Throws SolverFailure where Newton's method
/// finds no stable equilibrium near.
EquilibriumResult judged_by_tangent(Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions,
                                    const EquilibriumOptions& options, EquilibriumResult found,
                                    Observer& observer = silent_observer());

/// "L-BFGS", "dynamic relaxation", …
const char* name_of(EquilibriumMethod method);

}  // namespace tissuewarp::tled
