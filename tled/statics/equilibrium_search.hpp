#pragma once
/// What the methods of equilibrium() share: the start, counted evaluations, the lifted residual, refusals that name the
/// last good state.

#include "tled/equilibrium.hpp"
#include "tled/model/vectors.hpp"
#include "tled/stiffness/tangent_factor.hpp"

#include <optional>
#include <span>
#include <string>

namespace tissuewarp::tled::detail {

class EquilibriumSearch {
public:
    EquilibriumSearch(Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions,
                      const EquilibriumOptions& options, Observer& observer);

    /// The linear-elastic solution, or `start` plus the linear-elastic answer to its residual; or as much of that
    /// answer as leaves every det F positive: loads applied at once would tear the nodes next to them.
    Eigen::Matrix3Xd begin(const Eigen::Matrix3Xd* start);

    /// Moves the engine there at rest; false when a displacement is not finite or a tetrahedron is inverted whose law
    /// does not admit it, or which keep_upright() forbade.
    [[nodiscard]] bool admissible(const Eigen::Matrix3Xd& displacement);
    /// From now on whatever laws admit.
    void keep_upright() { upright_ = true; }
    /// Where steps lead, 3 × N mm; nothing where tissue is inverted there whose law does not admit it. Counted.
    [[nodiscard]] std::optional<Eigen::Matrix3Xd> stepped(std::span<const Steps> steps);
    /// At the engine's state. Counted; throws when too many or not finite.
    [[nodiscard]] Eigen::Matrix3Xd residual();
    /// K₀⁻¹ r, mm: to first order the displacement still missing.
    [[nodiscard]] Eigen::Matrix3Xd lifted(const Eigen::Matrix3Xd& residual);
    /// Counts evaluations about to be made elsewhere; throws when they are too many.
    void require_evaluations(int count);

    /// Records a good state and its estimated error, reports progress, polls for cancellation.
    void keep(const Eigen::Matrix3Xd& displacement, double error_mm);
    [[nodiscard]] const Eigen::Matrix3Xd& last_good() const { return good_; }
    /// Of the state that begin() made; K₀ was not corrected by anything seen since.
    [[nodiscard]] double correction_mm() const { return correction_mm_; }

    /// The last good state, checked once more.
    EquilibriumResult finish();
    /// The last good state plus what the tangent says is missing, where tissue admits it: better than the estimate of
    /// the state without it, which is kept.
    EquilibriumResult finish_with(const Eigen::Matrix3Xd& missing);
    [[noreturn]] void fail(const std::string& cause, const std::string& remedy) const;
    /// fail() with the engine's precision or the method as cause.
    [[noreturn]] void fail_stalled() const;

    Engine& engine;
    const RestStiffness& stiffness;
    const NodalConditions& conditions;
    const EquilibriumOptions& options;
    Observer& observer;

private:
    EquilibriumResult result_;
    Eigen::Matrix3Xd good_;
    double good_error_mm_ = 0, first_error_mm_ = 0, correction_mm_ = 0;
    SmallestJacobian smallest_;  ///< of the state tried last
    bool upright_ = false;
};

/// K₀ overestimates what it knows nothing about: soon after a linear start the true error was up to 1.5 times ‖K₀⁻¹
/// r‖∞.
constexpr double linear_start_safety = 1.5;
/// det F below which a linear start is shortened.
constexpr double least_starting_jacobian = 0.1;

EquilibriumResult lbfgs(EquilibriumSearch& search, const Eigen::Matrix3Xd* start);
EquilibriumResult dynamic_relaxation(EquilibriumSearch& search, const Eigen::Matrix3Xd* start);
/// options.rest is there; the factor is that of another state of the same tissue, or a new one.
EquilibriumResult newton(EquilibriumSearch& search, const Eigen::Matrix3Xd* start, TangentFactor& tangent);
/// A state that is nearly an equilibrium brought there and judged by the tangent; options.rest is there. Throws
/// SolverFailure where K₀ does not prepare that, or the tangent is not positive.
EquilibriumResult refinement(EquilibriumSearch& search, const Eigen::Matrix3Xd& start);
EquilibriumResult self_checked_relaxation(EquilibriumSearch& search, const Eigen::Matrix3Xd* start);

}  // namespace tissuewarp::tled::detail
