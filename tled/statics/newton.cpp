// Newton's method (Nocedal and Wright, Numerical Optimization (2006), algorithms 3.2 and 3.3) with the exact tangent of
// the tissue where it is, in float64: slow, and what decides whether there is an equilibrium. The factor of one state
// prepares conjugate gradients at the next ones (Dembo, Eisenstat, Steihaug, SIAM J. Numer. Anal. 19 (1982) 400).

#include "tled/statics/equilibrium_search.hpp"
#include "tled/statics/line_search.hpp"
#include "tled/stiffness/tangent_factor.hpp"

#include <algorithm>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr int most_iterations = 60;
constexpr int most_idle = 15;  // iterations without the correction falling by a tenth

/// The start as it is, with the imposed displacements in place; from rest the linear-elastic solution as far as no
/// tetrahedron is turned inside out.
Matrix3Xd first_state(EquilibriumSearch& search, const Matrix3Xd* start) {
    if (start == nullptr) return search.begin(nullptr);
    Matrix3Xd u = search.conditions.constrained.select(search.conditions.imposed, *start);
    return search.admissible(u) ? u : search.begin(start);
}

}  // namespace

EquilibriumResult newton(EquilibriumSearch& search, const Matrix3Xd* start) {
    TangentFactor tangent(*search.options.rest, search.conditions);
    Matrix3Xd u = first_state(search, start);
    if (!search.admissible(u)) search.fail_stalled();
    Matrix3Xd r = search.residual();
    double least = 0;
    bool last = false;
    for (int iteration = 0, idle = 0; iteration < most_iterations; ++iteration, ++idle) {
        std::optional<Matrix3Xd> by_other_factor;
        if (iteration > 0 && !last) by_other_factor = tangent.solve_at(u, r);
        if (!by_other_factor && !tangent.factorise(u)) search.fail_stalled();
        const Matrix3Xd d = by_other_factor ? *std::move(by_other_factor) : tangent.solve(r);
        const double correction = largest_norm(d);
        search.keep(u, correction);
        const bool near = correction <= search.options.tolerance_mm;
        if (near && !by_other_factor && tangent.shift() == 0) return search.finish_with(d);
        if (near && by_other_factor) {
            last = true;  // accepted by the factor where the tissue is alone, which also tells whether it is stable
            continue;
        }
        last = false;
        if (iteration == 0 || correction < 0.9 * least) {
            least = correction;
            idle = 0;
        }
        if (idle > most_idle) search.fail_stalled();
        std::optional<LineStep> step = line_search(search, u, r, d);
        if (!step) search.fail_stalled();
        u += step->length * d;
        r = std::move(step->residual);
    }
    search.fail_stalled();
}

}  // namespace tissuewarp::tled::detail
