// Newton's method with conjugate gradients that K₀ prepares (Dembo, Eisenstat, Steihaug, SIAM J. Numer. Anal. 19 (1982)
// 400), for a state that is nearly there: the other methods judge by K₀, which knows tissue only as it lay, and by
// float32 forces.

#include "tled/statics/equilibrium_search.hpp"
#include "tled/stiffness/conjugate_gradients.hpp"
#include "tled/stiffness/tangent_factor.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

EquilibriumResult refinement(EquilibriumSearch& search, const Matrix3Xd& start) {
    constexpr int most_iterations = 5, most_solves = 30;
    constexpr double solve_tolerance = 0.3;  // the answer is what it leaves off
    const NodalConditions& conditions = search.conditions;
    const Product metric = [&](const Matrix3Xd& f) { return search.stiffness.solve(f, conditions, solve_tolerance); };
    Matrix3Xd u = start;
    for (int iteration = 0; iteration < most_iterations && search.admissible(u); ++iteration) {
        const Matrix3Xd r = search.residual();
        const ConjugateGradients missing =
            conjugate_gradients_within(most_solves, tangent_product(*search.options.rest, conditions, u), metric,
                                       conditions.constrained.select(0.0, r), solve_tolerance);
        if (!missing.positive || missing.relative_residual > solve_tolerance) break;
        const double correction = largest_norm(missing.x);
        search.keep(u, correction);
        if (correction <= search.options.tolerance_mm) return search.finish_with(missing.x);
        u += missing.x;
    }
    search.fail_stalled();
}

}  // namespace tissuewarp::tled::detail
