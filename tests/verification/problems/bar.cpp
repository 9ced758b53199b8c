// p5: a square bar turned by 180°, and a cantilever under its weight.

#include "meshing/primitives.hpp"
#include "tests/verification/problems.hpp"
#include "tests/verification/reference_file.hpp"
#include "tests/verification/shapes.hpp"
#include "tests/verification/solution.hpp"

#include <cmath>

namespace tissuewarp::verification {

using Eigen::Vector3d;
using nlohmann::json;

namespace {

constexpr double bar_length = 6000.0, bar_width = 1000.0;  // mm
constexpr double length = 1000.0, height = 250.0;          // mm, of the cantilever
constexpr double weight = 9.81e-3;                         // mN/mm³

// −width/2 … width/2.
std::vector<double> centred(double width, int cells, double grading) {
    std::vector<double> result = graded_both_ways(width, cells, grading);
    for (double& x : result) x -= 0.5 * width;
    return result;
}

Quantity all_points(const json& file, const json& values,
                    std::function<Vector3d(const Solution&, const Vector3d&)> at) {
    return point_quantity(
        file.at("points"), values.at("u"), [](const Vector3d&) { return true; }, std::move(at));
}

}  // namespace

Problem bar_twist(Law law) {
    const json file = reference_file("p5_twist");
    const json& values = values_of(file, law);
    Problem problem;
    problem.name = "p5_twist";
    problem.law = law;
    problem.materials[1] = material_of(file, law);
    problem.mesh = [](int n) {
        return meshing::box_mesh(
            {centred(bar_width, n, 1.3), centred(bar_width, n, 1.3), graded_both_ways(bar_length, 3 * n, 1.3)});
    };
    problem.stages = 8;
    problem.hold = [stages = problem.stages](const Vector3d& X, int stage) {
        tled::PrescribedDisplacement held;
        const bool turned = near(X[2], bar_length), fixed = turned || near(X[2], 0.0);
        held.constrained = {fixed, fixed, fixed};
        if (!turned) return held;
        const double angle = M_PI * stage / stages, c = std::cos(angle) - 1.0, s = std::sin(angle);
        held.displacement << c * X[0] - s * X[1], s * X[0] + c * X[1], 0.0;
        return held;
    };
    const auto on_top = [](const Vector3d& X) { return near(X[2], bar_length); };
    const auto torque = [on_top](const Solution& s) {
        double sum = 0.0;
        for (const int i : s.nodes_on(on_top)) {
            const Vector3d x = s.nodes().col(i) + s.displacement.col(i);
            sum += x[0] * s.force(1, i) - x[1] * s.force(0, i);
        }
        return sum;
    };
    problem.quantities = {component_quantity("torque", "mN mm", values.at("torque"), 0, mNmm_per_J, torque),
                          component_quantity("axial force", "mN", values.at("axial_force"), 0, mN_per_N,
                                             [on_top](const Solution& s) { return s.reaction(on_top)[2]; }),
                          energy_quantity(values, 1.0),
                          all_points(file, values, [](const Solution& s, const Vector3d& X) { return s.at(X); })};
    problem.levels = {3, 6, 9, 12};
    problem.quadratic_levels = {1, 2, 3, 4};
    return problem;
}

// Half of the width.
Problem cantilever(Law law) {
    const json file = reference_file("p5_cantilever");
    const json& values = values_of(file, law);
    Problem problem;
    problem.name = "p5_cantilever";
    problem.law = law;
    problem.materials[1] = material_of(file, law);
    problem.mesh = [](int n) {
        return meshing::box_mesh(
            {graded(length, 4 * n, 1.5), centred(height, n, 1.3), graded_up(0.5 * height, n / 2, 1.3)});
    };
    problem.hold = [](const Vector3d& X, int) {
        tled::PrescribedDisplacement held;
        const bool fixed = near(X[0], 0.0);
        held.constrained = {fixed, fixed, fixed || near(X[2], 0.0)};
        return held;
    };
    problem.body_force = {0.0, -weight, 0.0};
    const auto tip = [](int component) {
        return [component](const Solution& s) { return s.at({length, 0.0, 0.0})[component]; };
    };
    problem.quantities = {component_quantity("tip x", "mm", values.at("tip"), 0, mm_per_m, tip(0)),
                          component_quantity("tip y", "mm", values.at("tip"), 1, mm_per_m, tip(1)),
                          energy_quantity(values, 2.0),
                          all_points(file, values, [](const Solution& s, const Vector3d& X) {
                              const Vector3d u = s.at({X[0], X[1], std::abs(X[2])});
                              return X[2] < 0.0 ? Vector3d(u[0], u[1], -u[2]) : u;
                          })};
    problem.levels = {4, 8, 12, 16};
    problem.quadratic_levels = {2, 4, 6, 8};
    return problem;
}

}  // namespace tissuewarp::verification
