// p7, p9: half balls bonded to their flat face: a breast under gravity, and one pressed by a rigid plane. One quarter.

#include "tests/verification/problems.hpp"
#include "tests/verification/reference_file.hpp"
#include "tests/verification/shapes.hpp"
#include "tests/verification/solution.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::verification {

using Eigen::Vector3d;
using nlohmann::json;

namespace {

constexpr double breast_radius = 60.0, ball_radius = 50.0;  // mm
constexpr double weight = 9.81e-3;                          // mN/mm³

// The cube's top face becomes the cap within `cap` of the pole. Cells shrink towards the flat face and the surface.
Problem half_ball(double radius, double cap, double grading) {
    Problem problem;
    const Rims rims{cap, M_PI - cap};
    problem.mesh = [radius, rims, grading](int n) {
        const std::vector<double> t = graded_up(1.0, n, grading);
        meshing::TetMesh mesh = symmetric_box({t, t, graded(1.0, n, grading)});
        for (auto X : mesh.nodes.colwise()) X = radius * ball_point(X, rims);
        return mesh;
    };
    problem.middle = [radius](const Vector3d& a, const Vector3d& b) {
        const Vector3d middle = 0.5 * (a + b);
        if (!near(a.norm(), radius) || !near(b.norm(), radius)) return middle;
        return Vector3d(radius * middle.normalized());
    };
    problem.hold = [](const Vector3d& X, int) {
        tled::PrescribedDisplacement held;
        const bool fixed = near(X[2], 0.0);
        held.constrained = {fixed || near(X[0], 0.0), fixed || near(X[1], 0.0), fixed};
        return held;
    };
    return problem;
}

// (r, z) pairs in the plane y = 0, with a third component of zero.
json in_plane(const json& pairs) {
    json result = json::array();
    for (const json& pair : pairs) result.push_back({pair[0], 0.0, pair[1]});
    return result;
}

// Largest deformed distance from the axis: the vertex of the parabola through the farthest node of the meridian y = 0
// and its two neighbours. The nodes themselves all lie below it, by an amount that depends on where they happen to be.
double largest_radius(const Solution& s) {
    const Eigen::Matrix3Xd deformed = s.nodes() + s.displacement;
    std::vector<int> meridian =
        s.nodes_on([](const Vector3d& X) { return near(X.norm(), ball_radius) && near(X[1], 0.0); });
    std::sort(meridian.begin(), meridian.end(), [&](int a, int b) { return deformed(2, a) < deformed(2, b); });
    const auto farthest = std::max_element(meridian.begin() + 1, meridian.end() - 1,
                                           [&](int a, int b) { return deformed(0, a) < deformed(0, b); });
    const Vector3d below = deformed.col(farthest[-1]), at = deformed.col(*farthest), above = deformed.col(farthest[1]);
    const double left = at[2] - below[2], right = above[2] - at[2];
    const double slope_left = (at[0] - below[0]) / left, slope_right = (above[0] - at[0]) / right;
    const double slope = (slope_left * right + slope_right * left) / (left + right);
    const double curvature = 2.0 * (slope_right - slope_left) / (left + right);
    return at[0] - 0.5 * slope * slope / curvature;
}

}  // namespace

Problem breast(Law law, Gravity gravity) {
    const json file = reference_file("p7_breast");
    const bool prone = gravity == Gravity::Prone;
    const json& values = file.at("values").at(prone ? "prone" : "supine").at(law == Law::Iso ? "iso" : "lnJ");
    Problem problem = half_ball(breast_radius, 0.8, 2.0);
    problem.name = prone ? "p7_breast, prone" : "p7_breast, supine";
    problem.law = law;
    problem.materials[1] = material_of(file, law);
    problem.body_force = {0.0, 0.0, prone ? weight : -weight};
    problem.quantities = {component_quantity("tip z", "mm", values.at("tip_uz"), 0, mm_per_m,
                                             [](const Solution& s) {
                                                 return s.at({0.0, 0.0, breast_radius})[2];
                                             }),
                          energy_quantity(values, 4.0),
                          component_quantity("volume", "mm³", values.at("volume_def"), 0, mm3_per_m3,
                                             [](const Solution& s) { return 4.0 * s.deformed_volume(); })};
    const auto add_points = [&](const char* name, const char* points, const char* key) {
        const json entry{{"value", in_plane(values.at(key).at("value"))},
                         {"uncertainty", in_plane(values.at(key).at("uncertainty"))}};
        Quantity quantity = point_quantity(
            in_plane(file.at(points)), entry, [](const Vector3d&) { return true; },
            [](const Solution& s, const Vector3d& X) { return s.at(X); });
        quantity.name = name;
        problem.quantities.push_back(std::move(quantity));
    };
    add_points("points", "points", "u_rz");
    add_points("surface points", "surface_points_rz", "u_surface_rz");
    problem.levels = {4, 8, 16};
    problem.quadratic_levels = {2, 4, 8};
    return problem;
}

Problem half_ball_contact(Law law, int step) {
    const json file = reference_file("p9_halfball_contact");
    const json& values = values_of(file, law);
    const double depth = file.at("delta_over_R").at(static_cast<std::size_t>(step)).get<double>();
    Problem problem = half_ball(ball_radius, 0.6, 1.3);
    char name[64];
    std::snprintf(name, sizeof name, "p9_halfball_contact, delta/R %g", depth);
    problem.name = name;
    problem.law = law;
    problem.materials[1] = material_of(file, law);
    problem.stages = 3;
    problem.plane_height = [depth, stages = problem.stages](int stage) {
        return ball_radius * (1.0 - depth * stage / stages);
    };
    problem.may_touch = [](const Vector3d& X) { return near(X.norm(), ball_radius); };
    const auto force = [](const Solution& s) {  // the flat face pushes up as much as the plane pushes down
        return 4.0 * s.reaction([](const Vector3d& X) { return near(X[2], 0.0); })[2];
    };
    problem.quantities = {component_quantity("force", "mN", values.at("force_N"), step, mN_per_N, force)};
    if (!values.at("max_radius_m").at("value").at(static_cast<std::size_t>(step)).is_null()) {
        problem.quantities.push_back(
            component_quantity("bulge", "mm", values.at("max_radius_m"), step, mm_per_m, largest_radius));
    }
    problem.levels = {4, 8, 16};
    return problem;
}

}  // namespace tissuewarp::verification
