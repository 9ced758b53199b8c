// Newton's method (Nocedal and Wright, Numerical Optimization (2006), algorithms 3.2 and 3.3) with the exact tangent of
// the tissue where it is, in float64: slow, and what decides whether there is an equilibrium. The factor of one state
// prepares conjugate gradients at the next ones (Dembo, Eisenstat, Steihaug, SIAM J. Numer. Anal. 19 (1982) 400).

#include "tled/statics/equilibrium_search.hpp"
#include "tled/statics/finite_rotations.hpp"
#include "tled/statics/line_search.hpp"
#include "tled/statics/one_sided_contact.hpp"
#include "tled/stiffness/dot.hpp"
#include "tled/stiffness/tangent_factor.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr int most_iterations = 60;
constexpr const char* of_several =
    "on the way to it the tissue was not stable: where it buckles or snaps through there are several equilibria, of "
    "which this is a stable one";
constexpr int most_saddles = 5, most_crawling = 3;  // iterations near one, by steps that hardly become shorter
constexpr int most_idle = 15;  // iterations without the correction or the residual falling by a tenth

/// The start as it is, with the imposed displacements in place; from rest the linear-elastic solution turned by finite
/// angles, or as far as no tetrahedron is turned inside out.
Matrix3Xd first_state(EquilibriumSearch& search, const FiniteRotations& rotations, const Matrix3Xd* start) {
    if (start == nullptr) {
        const Matrix3Xd linear = search.stiffness.linear_solution(search.conditions);
        Matrix3Xd turned = rotations.moved(Matrix3Xd::Zero(3, linear.cols()), linear);
        return search.admissible(turned) ? turned : search.begin(nullptr);
    }
    Matrix3Xd u = search.conditions.constrained.select(search.conditions.imposed, *start);
    return search.admissible(u) ? u : search.begin(start);
}

/// Whether going from `u`, with its residual `r`, to `next` led downhill and not too far; the residual is then that
/// there.
bool taken(EquilibriumSearch& search, const Matrix3Xd& u, const Matrix3Xd& next, Matrix3Xd& r) {
    constexpr double slope_kept = 0.9;
    const double start = dot(r, next - u);
    if (!(start > 0) || !search.admissible(next)) return false;
    Matrix3Xd there = search.residual();
    if (std::abs(dot(there, next - u)) > slope_kept * start) return false;
    r = std::move(there);
    return true;
}

/// From a saddle by a hundredth of the body's size along a direction in which energy falls, or as much of it as turns
/// nothing inside out, to the side where the residual `r` leads; that is then the one there.
bool left_saddle(EquilibriumSearch& search, Matrix3Xd& u, const Matrix3Xd& falling, Matrix3Xd& r) {
    constexpr double of_diagonal = 0.01;
    const Matrix3Xd& position = search.options.rest->position;
    const double diagonal = (position.rowwise().maxCoeff() - position.rowwise().minCoeff()).norm();
    Matrix3Xd step = of_diagonal * diagonal / largest_norm(falling) * falling;
    if (dot(r, step) < 0) step = -step;
    for (int trial = 0; trial < 8; ++trial, step *= 0.5)
        if (search.admissible(u + step)) {
            u += step;
            r = search.residual();
            return true;
        }
    return false;
}

/// What gives the tangent at `u`: the springs of contact that push there too.
NodalConditions tangent_conditions(const EquilibriumSearch& search, const Matrix3Xd& u) {
    const OneSidedContact* contact = search.options.one_sided;
    return contact != nullptr ? contact->stiffened(search.conditions, u) : search.conditions;
}

/// As much of a correction as leaves no node more than an edge from where it was: farther on tissue may have passed
/// through a body and find no contact on its other side.
Matrix3Xd short_of_bodies(const EquilibriumSearch& search, const Matrix3Xd& d) {
    if (search.options.one_sided == nullptr) return d;
    return std::min(1.0, std::cbrt(search.options.rest->volume.mean()) / largest_norm(d)) * d;
}

/// Whether corrections that go on to shrink as the second did against the first leave no more than the tolerance.
bool settles(const Matrix3Xd& first, const Matrix3Xd& second, double tolerance_mm) {
    const double before = largest_norm(first), now = largest_norm(second), contraction = now / before;
    return now == 0 || (now < before && now * contraction / (1 - contraction) <= tolerance_mm);
}

/// What the last factor misses after a correction of its own, `d`, which is then part of `u`: slender tissue far from
/// rest may be off by more than that. The residual there is `r` then. Nothing where the correction turns tissue inside
/// out.
std::optional<Matrix3Xd> missing_after(EquilibriumSearch& search, const TangentFactor& tangent, Matrix3Xd& u,
                                       Matrix3Xd& r, const Matrix3Xd& d) {
    if (!search.admissible(u + d)) return std::nullopt;
    u += d;
    r = search.residual();
    Matrix3Xd missing = tangent.solve(r);
    search.keep(u, largest_norm(missing));
    return missing;
}

}  // namespace

EquilibriumResult newton(EquilibriumSearch& search, const Matrix3Xd* start, TangentFactor& tangent) {
    const FiniteRotations rotations(*search.options.rest, search.conditions);
    search.keep_upright();  // elsewhere there is no tangent
    Matrix3Xd u = first_state(search, rotations, start);
    if (!search.admissible(u)) search.fail_stalled();
    Matrix3Xd r = search.residual();
    double least = 0, least_residual = r.norm();
    bool was_unstable = false;
    bool last = false;
    int saddles = 0, crawling = 0;
    int settled = 0;  // times in a row; where tissue was unstable once does not tell
    double before = 0;
    for (int iteration = 0, idle = 0; iteration < most_iterations; ++iteration, ++idle) {
        const NodalConditions conditions = tangent_conditions(search, u);
        TangentFactor::Prepared prepared;
        if (!last) prepared = tangent.solve_at(conditions, u, r);
        was_unstable |= !prepared.positive;
        if (!prepared.x) {
            if (!(prepared.positive ? tangent.factorise(conditions, u)
                                    : tangent.factorise_positive_part(conditions, u)))
                search.fail_stalled();
            was_unstable |= !tangent.stable();
        }
        const Matrix3Xd d = prepared.x ? *prepared.x : tangent.solve(r);
        const double correction = largest_norm(d);
        search.keep(u, correction);
        const bool near = correction <= search.options.tolerance_mm;
        if (!near) settled = 0;
        if (near && (prepared.x ? prepared.positive && search.options.on_the_way : tangent.stable())) {
            const bool on_the_way = search.options.on_the_way;
            const std::optional<Matrix3Xd> missing = on_the_way ? d : missing_after(search, tangent, u, r, d);
            settled = missing && settles(d, *missing, search.options.tolerance_mm) ? settled + 1 : 0;
            if (on_the_way || settled >= (was_unstable ? 2 : 1)) {
                if (saddles > 0 || (start == nullptr && was_unstable)) search.observer.note(of_several);
                return search.finish_with(*missing);
            }
            last = false;
            if (missing) continue;
        }
        crawling = !prepared.positive && correction > 0.5 * before ? crawling + 1 : 0;
        before = correction;
        if (!prepared.positive && (near || crawling > most_crawling) && ++saddles < most_saddles &&
            left_saddle(search, u, prepared.falling, r)) {
            idle = crawling = 0;
            continue;
        }
        if (near && prepared.x) {
            last = true;  // accepted by the factor where the tissue is alone, which also tells whether it is stable
            continue;
        }
        last = false;
        // Corrections by conjugate gradients that stopped at a falling direction are short, and no measure by
        // themselves.
        if (iteration == 0 || correction < 0.9 * least) {
            least = correction;
            idle = 0;
        }
        if (r.norm() < 0.9 * least_residual) {
            least_residual = r.norm();
            idle = 0;
        }
        if (idle > most_idle) search.fail_stalled();
        const Matrix3Xd way = short_of_bodies(search, d);
        if (Matrix3Xd next = rotations.moved(u, way); taken(search, u, next, r)) {
            u = std::move(next);
            continue;
        }
        std::optional<LineStep> step = line_search(search, u, r, way);
        if (!step) search.fail_stalled();
        u += step->length * way;
        r = std::move(step->residual);
    }
    search.fail_stalled();
}

}  // namespace tissuewarp::tled::detail
