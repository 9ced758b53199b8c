// p4: Cook's membrane, sheared by a dead traction on its right face.

#include "meshing/primitives.hpp"
#include "tests/verification/problems.hpp"
#include "tests/verification/reference_file.hpp"
#include "tests/verification/shapes.hpp"
#include "tests/verification/solution.hpp"

#include <cmath>
#include <cstdio>

namespace tissuewarp::verification {

using Eigen::Vector3d;
using nlohmann::json;

namespace {

constexpr double width = 48.0, left_height = 44.0, right_low = 44.0, right_high = 60.0;  // mm
constexpr double traction_kpa = 0.08, youngs_modulus_kpa = 3.0;

// Cells between the planes x (0 … 1 from the fixed face to the loaded one), n graded ones across, and the planes z.
meshing::TetMesh membrane(const std::vector<double>& x, int n, const std::vector<double>& z) {
    meshing::TetMesh mesh = meshing::box_mesh({x, graded_both_ways(1.0, n, 2.2), z});
    for (auto X : mesh.nodes.colwise()) {
        const double low = right_low * X[0], high = left_height + (right_high - left_height) * X[0];
        X.head<2>() << width * X[0], low + (high - low) * X[1];
    }
    return mesh;
}

// Towards both ends, most towards the fixed one, whose corners are singular.
std::vector<double> along(int n) {
    std::vector<double> x = graded_both_ways(1.0, n, 1.6);
    for (double& t : x) t = std::pow(t, 1.6);
    return x;
}

const json* poisson_values(const json& file, Law law, double nu) {
    char key[16];
    std::snprintf(key, sizeof key, "nu=%g", nu);
    const json& values = file.at("values").at(key);
    const auto found = values.find(law == Law::Iso ? "iso" : "lnJ");
    return found == values.end() ? nullptr : &*found;
}

Problem loaded(const char* file, Law law, double nu) {
    char name[64];
    std::snprintf(name, sizeof name, "%s, nu %g", file, nu);
    Problem problem;
    problem.name = name;
    problem.law = law;
    problem.materials[1] = material_of(youngs_modulus_kpa, nu, law);
    problem.tractions = {{[](const Vector3d& X) { return near(X[0], width); }, {0.0, traction_kpa, 0.0}}};
    return problem;
}

// Component `component` of the displacement at X.
std::function<double(const Solution&)> displacement_at(const Vector3d& X, int component) {
    return [X, component](const Solution& s) { return s.at(X)[component]; };
}

}  // namespace

// One layer of cells with u_z = 0 everywhere.
Problem cook_plane_strain(Law law, double nu) {
    const json file = reference_file("p4_cook_plane_strain");
    const json& values = *poisson_values(file, law, nu);
    Problem problem = loaded("p4_cook_plane_strain", law, nu);
    const auto thickness = [](int n) { return width / n; };
    problem.mesh = [thickness](int n) { return membrane(along(n), n, {0.0, thickness(n)}); };
    problem.hold = [](const Vector3d& X, int) {
        tled::PrescribedDisplacement held;
        held.constrained = {near(X[0], 0.0), near(X[0], 0.0), true};
        return held;
    };
    const double middle = 0.5 * (right_low + right_high);
    const auto tip = [&](const char* name, const char* key, int component, double y) {
        return component_quantity(name, "mm", values.at(key), component, mm_per_m,
                                  displacement_at({width, y, 0.0}, component));
    };
    problem.quantities = {tip("tip x", "tip_mid", 0, middle), tip("tip y", "tip_mid", 1, middle),
                          tip("top corner y", "tip_top_C", 1, right_high)};
    problem.quantities.push_back(component_quantity(  // J/m is mN
        "energy per thickness", "mN", values.at("energy_per_thickness"), 0, mN_per_N,
        [](const Solution& s) { return s.energy / s.mesh.nodes.row(2).maxCoeff(); }));
    json points = json::array(), entry{{"value", json::array()}, {"uncertainty", json::array()}};
    for (std::size_t i = 0; i < file.at("points").size(); ++i) {
        const auto with_z = [i](json pairs) {
            pairs[i].push_back(0.0);
            return pairs[i];
        };
        points.push_back(with_z(file.at("points")));
        for (const char* key : {"value", "uncertainty"}) entry[key].push_back(with_z(values.at("u").at(key)));
    }
    problem.quantities.push_back(point_quantity(
        points, entry, [](const Vector3d&) { return true; },
        [](const Solution& s, const Vector3d& X) { return s.at(X); }));
    problem.levels = {16, 32, 48, 64};
    problem.quadratic_levels = {4, 8, 12, 16};
    return problem;
}

// Half of the thickness.
std::optional<Problem> cook_3d(Law law, double nu) {
    const json file = reference_file("p4_cook_3d");
    const json* values = poisson_values(file, law, nu);
    if (values == nullptr) return std::nullopt;
    Problem problem = loaded("p4_cook_3d", law, nu);
    problem.mesh = [](int n) { return membrane(graded(1.0, n, 2.6), n, graded_up(5.0, n / 4, 1.5)); };
    problem.hold = [](const Vector3d& X, int) {
        tled::PrescribedDisplacement held;
        const bool fixed = near(X[0], 0.0);
        held.constrained = {fixed, fixed, fixed || near(X[2], 0.0)};
        return held;
    };
    const double middle = 0.5 * (right_low + right_high);
    const auto tip = [&](const char* name, const char* key, int component, const Vector3d& X) {
        return component_quantity(name, "mm", values->at(key), component, mm_per_m, displacement_at(X, component));
    };
    problem.quantities = {
        tip("tip x", "tip_mid_z_mid", 0, {width, middle, 0.0}), tip("tip y", "tip_mid_z_mid", 1, {width, middle, 0.0}),
        tip("tip y on the face", "tip_mid_z_face", 1, {width, middle, 5.0}),
        tip("top corner y", "tip_top_C_z_mid", 1, {width, right_high, 0.0}), energy_quantity(*values, 2.0)};
    problem.levels = {8, 16, 24, 32};
    problem.quadratic_levels = {4, 8, 12, 16};
    return problem;
}

}  // namespace tissuewarp::verification
