#include "tled/statics/equilibrium_search.hpp"

#include "tled/statics/one_sided_contact.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr double solve_tolerance = 1e-2;  // of lifted residuals when the springs are not those factorised

std::string text(double value) {
    char digits[32];
    std::snprintf(digits, sizeof digits, "%.3g", value);
    return digits;
}

std::string place(const SmallestJacobian& smallest) {
    return "det F = " + text(smallest.value) + " in tetrahedron " + std::to_string(smallest.tet);
}

}  // namespace

EquilibriumSearch::EquilibriumSearch(Engine& engine_, const RestStiffness& stiffness_,
                                     const NodalConditions& conditions_, const EquilibriumOptions& options_,
                                     Observer& observer_)
    : engine(engine_), stiffness(stiffness_), conditions(conditions_), options(options_), observer(observer_) {
    engine.set_conditions(conditions);
}

Matrix3Xd EquilibriumSearch::begin(const Matrix3Xd* start) {
    Matrix3Xd base = Matrix3Xd::Zero(3, conditions.constrained.cols()), correction;
    if (start == nullptr) {
        correction = stiffness.linear_solution(conditions);
    } else {
        base = *start;
        if (!admissible(base))
            fail("the start is not admissible (" + place(smallest_) + ")", "start from another displacement");
        correction = lifted(residual());
    }
    if (!correction.allFinite())
        fail("the linear-elastic solution is not finite", "check the springs and forces for extreme values");
    for (double part = 1; part > 0.01; part *= 0.7) {
        Matrix3Xd u = base + part * correction;
        if (!admissible(u) || (smallest_.value <= least_starting_jacobian && !engine.admits_inversion())) continue;
        correction_mm_ = part * largest_norm(correction);
        return conditions.constrained.select(conditions.imposed, u);
    }
    fail("no start leaves every tetrahedron positive (" + place(smallest_) + ")", "apply the load in parts");
}

bool EquilibriumSearch::admissible(const Matrix3Xd& displacement) {
    smallest_ = {-std::numeric_limits<double>::infinity(), -1};
    if (!displacement.allFinite()) return false;
    engine.set_state(displacement, Matrix3Xd::Zero(3, displacement.cols()));
    smallest_ = engine.smallest_jacobian();
    return smallest_.value > 0 || (!upright_ && engine.admits_inversion() && std::isfinite(smallest_.value));
}

void EquilibriumSearch::require_evaluations(int count) {
    if (result_.force_evaluations + count > options.max_steps)
        fail("not reached in " + std::to_string(options.max_steps) + " force evaluations",
             "allow more steps or a larger tolerance");
    result_.force_evaluations += count;
}

std::optional<Matrix3Xd> EquilibriumSearch::stepped(std::span<const Steps> steps) {
    for (const Steps& each : steps) require_evaluations(each.count);
    CheckedDisplacement u = engine.run_and_check(steps);
    const bool inverted = !(u.smallest.value > 0);
    if (!u.value.allFinite() || (inverted && !engine.admits_inversion())) return std::nullopt;
    return std::move(u.value);
}

Matrix3Xd EquilibriumSearch::residual() {
    require_evaluations(1);
    Matrix3Xd r = engine.residual();
    if (options.one_sided != nullptr)
        r = conditions.constrained.select(r, r + options.one_sided->force(engine.displacement()));
    if (!r.allFinite())
        fail("the forces are not finite (" + place(smallest_) + ")", "use a finer mesh there or softer springs");
    return r;
}

Matrix3Xd EquilibriumSearch::lifted(const Matrix3Xd& residual) {
    ++result_.lifted_residuals;
    return stiffness.solve(residual, conditions, solve_tolerance);
}

void EquilibriumSearch::keep(const Matrix3Xd& displacement, double error_mm) {
    good_ = displacement;
    good_error_mm_ = error_mm;
    const double tolerance = options.tolerance_mm;
    first_error_mm_ = std::max({first_error_mm_, error_mm, 2 * tolerance});
    const double progress =
        std::log(first_error_mm_ / std::max(error_mm, tolerance)) / std::log(first_error_mm_ / tolerance);
    observer.checkpoint("equilibrium", std::clamp(progress, 0.0, 1.0));
}

EquilibriumResult EquilibriumSearch::finish() {
    engine.set_state(good_, Matrix3Xd::Zero(3, good_.cols()));
    CheckedDisplacement last = engine.run_and_check({});
    smallest_ = last.smallest;
    if (!(smallest_.value > 0))
        fail("it holds inverted tissue (" + place(smallest_) + "), which its law admits",
             "take neo-hookean-lnj, which does not, smaller loads or softer springs");
    result_.displacement = std::move(last.value);
    result_.estimated_error_mm = good_error_mm_;
    result_.min_jacobian = smallest_.value;
    return std::move(result_);
}

EquilibriumResult EquilibriumSearch::finish_with(const Matrix3Xd& missing) {
    if (const Matrix3Xd u = good_ + missing; admissible(u)) keep(u, good_error_mm_);
    return finish();
}

void EquilibriumSearch::fail(const std::string& cause, const std::string& remedy) const {
    std::string last = "; no good state";
    if (good_.size() > 0)
        last = "; last good state: estimated error " + text(good_error_mm_) + " mm, asked for " +
               text(options.tolerance_mm) + " mm";
    throw SolverFailure("no equilibrium: " + cause + last + ", " + std::to_string(result_.force_evaluations) +
                        " force evaluations; " + remedy);
}

void EquilibriumSearch::fail_stalled() const {
    constexpr double single_precision = 1e-8, nearly_flat = 1e-3;
    if (upright_ && smallest_.value < nearly_flat)
        fail("tissue is about to turn inside out (" + place(smallest_) + ")",
             "take neo-hookean-lnj in place of neo-hookean-stable, which admits that, smaller loads or a finer mesh "
             "there");
    if (engine.precision() > single_precision)
        fail("the error stopped falling where float32 forces end (" + place(smallest_) + ")",
             "take a larger tolerance, or of a scene forces in float64");
    fail("the error stopped falling (" + place(smallest_) + ")",
         "take another method, a finer mesh there, or apply the load in parts");
}

}  // namespace tissuewarp::tled::detail
