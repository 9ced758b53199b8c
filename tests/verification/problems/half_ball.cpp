// p7, p9: half balls bonded to their flat face: a breast under gravity, and one pressed by a rigid plane. One quarter.

#include "tests/verification/problems.hpp"
#include "tests/verification/reference_file.hpp"
#include "tests/verification/shapes.hpp"
#include "tests/verification/solution.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace tissuewarp::verification {

using Eigen::Vector2d;
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

// Polar angle at rest (rad) of the rim of the contact, where our meshes have the deformed radius that the reference
// gives for it: which part of the cap touches is then the same on meshes of all levels.
double contact_rim(double depth_over_radius) {
    return depth_over_radius < 0.15 ? 0.3508 : 0.5284;  // of a tenth and a fifth
}

// Distance from the axis at the vertex of the parabola through the farthest of some points (distance, height) and its
// two neighbours. The points themselves lie below it, by an amount that depends on where they happen to be.
double farthest_of_curve(std::vector<Vector2d> points) {
    std::sort(points.begin(), points.end(), [](const Vector2d& a, const Vector2d& b) { return a[1] < b[1]; });
    const auto at = std::max_element(points.begin() + 1, points.end() - 1,
                                     [](const Vector2d& a, const Vector2d& b) { return a[0] < b[0]; });
    const Vector2d below = *at - at[-1], above = at[1] - *at;
    const double slope_below = below[0] / below[1], slope_above = above[0] / above[1], height = below[1] + above[1];
    const double slope = (slope_below * above[1] + slope_above * below[1]) / height;
    const double curvature = 2.0 * (slope_above - slope_below) / height;
    return (*at)[0] - 0.5 * slope * slope / curvature;
}

// Largest deformed radius, the mean over the meridians of the mesh beside the cap: tetrahedra bulge a little more along
// some than along others.
double bulge_radius(const Solution& s, double cap) {
    std::map<long, std::vector<Vector2d>> meridians;  // by azimuth
    for (const int i : s.nodes_on([](const Vector3d& X) { return near(X.norm(), ball_radius); })) {
        const Vector3d X = s.nodes().col(i), x = X + s.displacement.col(i);
        if (X.head<2>().norm() < ball_radius * (std::sin(cap) - 1e-9)) continue;
        meridians[std::lround(1e6 * std::atan2(X[1], X[0]))].emplace_back(x.head<2>().norm(), x[2]);
    }
    double sum = 0.0, shares = 0.0;  // the two on the symmetry planes stand for half as much as the others
    for (const auto& [azimuth, points] : meridians) {
        const double share = azimuth == meridians.begin()->first || azimuth == meridians.rbegin()->first ? 0.5 : 1.0;
        sum += share * farthest_of_curve(points);
        shares += share;
    }
    return sum / shares;
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
    problem.levels = {4, 8, 12, 16};
    problem.quadratic_levels = {4, 6, 7, 9};
    return problem;
}

Problem half_ball_contact(Law law, int step) {
    const json file = reference_file("p9_halfball_contact");
    const json& values = values_of(file, law);
    const double depth = file.at("delta_over_R").at(static_cast<std::size_t>(step)).get<double>();
    const double rim = contact_rim(depth);
    Problem problem = half_ball(ball_radius, rim, 1.7);  // the bulge is highest 4 mm from the bonded face
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
            component_quantity("bulge", "mm", values.at("max_radius_m"), step, mm_per_m,
                               [rim](const Solution& s) { return bulge_radius(s, rim); }));
    }
    problem.levels = {4, 8, 12, 16};
    return problem;
}

}  // namespace tissuewarp::verification
