// Newton's method (Nocedal and Wright, Numerical Optimization (2006), algorithms 3.2 and 3.3) with the exact tangent of
// the tissue where it is, in float64: slow, and what decides whether there is an equilibrium. A factor is kept while
// corrections shrink fast enough under it.

#include "tled/statics/equilibrium_search.hpp"
#include "tled/statics/line_search.hpp"
#include "tled/stiffness/tangent_factor.hpp"

#include <algorithm>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr double contraction_kept = 0.2;  // of corrections, above which the tangent is taken anew
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
    double before = 0, least = 0;
    bool renew = true;
    for (int iteration = 0, idle = 0; iteration < most_iterations; ++iteration, ++idle) {
        if (renew && !tangent.factorise(u)) search.fail_stalled();
        const Matrix3Xd d = tangent.solve(r);
        const double correction = largest_norm(d);
        const double contraction = renew || !(before > 0) ? 0 : correction / before;
        if (!renew && contraction > contraction_kept) {
            renew = true;
            continue;
        }
        search.keep(u, correction);
        if (correction <= search.options.tolerance_mm && tangent.shift() == 0) {
            if (renew) return search.finish();
            renew = true;  // accepted by the tangent where the tissue is alone
            continue;
        }
        if (iteration == 0 || correction < 0.9 * least) {
            least = correction;
            idle = 0;
        }
        if (idle > most_idle) search.fail_stalled();
        std::optional<LineStep> step = line_search(search, u, r, d);
        if (!step) search.fail_stalled();
        u += step->length * d;
        r = std::move(step->residual);
        renew = step->length != 1 || tangent.shift() > 0;
        before = correction;
    }
    search.fail_stalled();
}

}  // namespace tissuewarp::tled::detail
