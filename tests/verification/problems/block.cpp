// p9: a block between two frictionless rigid planes, a homogeneous state in closed form. One quarter.

#include "meshing/primitives.hpp"
#include "tests/verification/problems.hpp"
#include "tests/verification/reference_file.hpp"
#include "tests/verification/solution.hpp"

#include <cstdio>

namespace tissuewarp::verification {

using Eigen::Vector3d;
using nlohmann::json;

namespace {

constexpr double edge = 100.0, half = 50.0;  // mm

}  // namespace

Problem block_contact(Law law, int step) {
    const json file = reference_file("p9_block_contact");
    const json& state = values_of(file, law).at(static_cast<std::size_t>(step));
    const double compression = state.at("compression").get<double>();
    Problem problem;
    char name[64];
    std::snprintf(name, sizeof name, "p9_block_contact, %g", compression);
    problem.name = name;
    problem.law = law;
    problem.materials[1] = material_of(file, law);
    problem.mesh = [](int n) { return meshing::box_mesh({half, half, edge}, {n, n, 2 * n}, 0.1, 5); };
    problem.hold = [](const Vector3d& X, int) {
        tled::PrescribedDisplacement held;
        held.constrained = {near(X[0], 0.0), near(X[1], 0.0), near(X[2], 0.0)};
        return held;
    };
    problem.stages = 2;
    problem.plane_height = [compression, stages = problem.stages](int stage) {
        return edge * (1.0 - compression * stage / stages);
    };
    problem.may_touch = [](const Vector3d& X) { return near(X[2], edge); };
    const auto entry = [&](const char* key) {  // closed form, printed with eight digits
        const double value = state.at(key).get<double>();
        return json{{"value", value}, {"uncertainty", 1e-7 * std::abs(value)}};
    };
    problem.quantities = {
        component_quantity(
            "force", "mN", entry("force_N"), 0, mN_per_N,
            [](const Solution& s) { return -4.0 * s.reaction([](const Vector3d& X) { return near(X[2], 0.0); })[2]; }),
        component_quantity("side", "mm", entry("u_x_at_side"), 0, mm_per_m, [](const Solution& s) {
            return s.at({half, 0.0, half})[0];
        })};
    problem.levels = {1, 2, 3, 4};
    return problem;
}

}  // namespace tissuewarp::verification
