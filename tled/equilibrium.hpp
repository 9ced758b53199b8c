#pragma once
/// Static equilibrium by dynamic relaxation, stopped by a checked displacement error.

#include "core/observer.hpp"
#include "tled/engine.hpp"
#include "tled/rest_stiffness.hpp"

namespace tissuewarp::tled {

struct EquilibriumOptions {
    double tolerance_mm = 0.05;  ///< accepted largest nodal error, by the lifted residual ‖K₀⁻¹ r‖∞
    int max_steps = 4000;        ///< force evaluations
    int steps_per_check = 25;    ///< steps recorded between two looks at the state
};

struct EquilibriumResult {
    Eigen::Matrix3Xd displacement;  ///< 3 × N, mm
    double estimated_error_mm = 0;  ///< lifted residual at the end
    int force_evaluations = 0;
    int lifted_residuals = 0;  ///< triangular solves spent on acceptance
    double min_jacobian = 1;
};

/// Relaxes the engine to equilibrium under the conditions: mass = diag K₀, damping preset from the lowest mode of K₀
/// and adapted by the Rayleigh quotient of the motion (Joldes, Wittek, Miller 2011). Starts from the linear-elastic
/// solution, or from `start` (3 × N mm) plus the linear-elastic answer to its residual. Throws SolverFailure when the
/// error bound is not reached or tissue inverts for good.
EquilibriumResult equilibrium(Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions,
                              const EquilibriumOptions& options = {}, const Eigen::Matrix3Xd* start = nullptr,
                              Observer& observer = silent_observer());

}  // namespace tissuewarp::tled
