// p6: a brain-like ellipsoid held below and pressed from above; plain, and with a stiff ball inside.

#include "tests/verification/problems.hpp"
#include "tests/verification/reference_file.hpp"
#include "tests/verification/shapes.hpp"
#include "tests/verification/solution.hpp"

#include <cmath>

namespace tissuewarp::verification {

using Eigen::Vector3d;
using nlohmann::json;

namespace {

const Vector3d semi_axes(70.0, 55.0, 50.0);  // mm
constexpr double fixed_below = -30.0, moved_above = 40.0, pressed_mm = 10.0;
const Rims rims{std::acos(0.8), M_PI - std::acos(0.6)};
constexpr double grading = 1.5;

const Vector3d centre(20.0, 0.0, 5.0);  // of the inclusion, mm
constexpr double radius = 10.0, stiffer = 20.0;
constexpr double shell_grading = 2.0;  // of the cells between it and the surface, half as many as without it

// −1 … 1 by mirroring.
std::vector<double> mirrored(const std::vector<double>& positive) {
    std::vector<double> result;
    for (std::size_t i = positive.size() - 1; i > 0; --i) result.push_back(-positive[i]);
    result.insert(result.end(), positive.begin(), positive.end());
    return result;
}

bool on_surface(const Vector3d& X) {
    return near(X.cwiseQuotient(semi_axes).squaredNorm(), 1.0);
}

// Onto the ellipsoid: along z = const on a rim, so that it stays a circle there, otherwise along the ray.
Vector3d surface_middle(const Vector3d& a, const Vector3d& b) {
    Vector3d unit = (0.5 * (a + b)).cwiseQuotient(semi_axes);
    if (!on_surface(a) || !on_surface(b)) return 0.5 * (a + b);
    if (near(a[2], b[2])) {
        unit.head<2>() *= std::sqrt(1.0 - unit[2] * unit[2]) / unit.head<2>().norm();
    } else {
        unit.normalize();
    }
    return unit.cwiseProduct(semi_axes);
}

tled::PrescribedDisplacement held_patches(const Vector3d& X) {
    constexpr double rounding = 1e-9;
    tled::PrescribedDisplacement held;
    const bool moved = on_surface(X) && X[2] >= moved_above - rounding;
    const bool fixed = moved || (on_surface(X) && X[2] <= fixed_below + rounding);
    held.constrained = {fixed, fixed, fixed};
    if (moved) held.displacement[2] = -pressed_mm;
    return held;
}

double pressing_force(const Solution& s) {
    return s.reaction([](const Vector3d& X) { return on_surface(X) && X[2] >= moved_above - 1e-9; })[2];
}

// Displacement by mirroring in x = 0 and y = 0 where the part lies on their positive sides alone.
std::function<Vector3d(const Solution&, const Vector3d&)> unfolded(bool fold_x) {
    return [fold_x](const Solution& s, const Vector3d& X) {
        const Vector3d sign(fold_x && X[0] < 0.0 ? -1.0 : 1.0, X[1] < 0.0 ? -1.0 : 1.0, 1.0);
        return Vector3d(sign.cwiseProduct(s.at(sign.cwiseProduct(X))));
    };
}

Problem pressed_ellipsoid(const char* name, const json& file, Law law, double parts) {
    const json& values = values_of(file, law);
    Problem problem;
    problem.name = name;
    problem.law = law;
    problem.materials[1] = material_of(file, law);
    problem.middle = surface_middle;
    problem.quantities = {
        component_quantity("force z", "mN", values.at("force"), 2, mN_per_N,
                           [parts](const Solution& s) { return parts * pressing_force(s); }),
        energy_quantity(values, parts),
        point_quantity(
            file.at("points"), values.at("u"), [](const Vector3d&) { return true; }, unfolded(parts > 2.0))};
    problem.levels = {4, 8, 12, 16};
    problem.quadratic_levels = {2, 4, 6, 8};
    return problem;
}

}  // namespace

// One quarter.
Problem ellipsoid_plain(Law law) {
    Problem problem = pressed_ellipsoid("p6_ellipsoid_plain", reference_file("p6_ellipsoid_plain"), law, 4.0);
    problem.mesh = [](int n) {
        const std::vector<double> t = graded_up(1.0, n, grading);
        meshing::TetMesh mesh = symmetric_box({t, t, mirrored(t)});
        for (auto X : mesh.nodes.colwise()) X = ball_point(X, rims).cwiseProduct(semi_axes);
        return mesh;
    };
    problem.hold = [](const Vector3d& X, int) {
        tled::PrescribedDisplacement held = held_patches(X);
        if (near(X[0], 0.0)) held.constrained[0] = true;
        if (near(X[1], 0.0)) held.constrained[1] = true;
        return held;
    };
    return problem;
}

// One half: shells around the ball out to half of the cube's coordinate, then on to the surface.
Problem ellipsoid_inclusion() {
    const json file = reference_file("p6_ellipsoid_inclusion");
    Problem problem = pressed_ellipsoid("p6_ellipsoid_inclusion", file, Law::Iso, 2.0);
    constexpr double interface = 0.5;
    auto inclusion = std::get<tled::NeoHookeanIso>(problem.materials.at(1));
    inclusion.shear_modulus *= stiffer;
    inclusion.bulk_modulus *= stiffer;
    problem.materials[2] = inclusion;
    problem.mesh = [](int n) {
        std::vector<double> t = graded(interface, n / 2, 1.0);
        for (const double outer : graded_up(1.0, n / 2, shell_grading)) {
            if (outer > 0.0) t.push_back(interface + (1.0 - interface) * outer);
        }
        std::vector<double> all = mirrored(t);
        meshing::TetMesh mesh = symmetric_box({all, t, all});
        for (int e = 0; e < mesh.tet_count(); ++e) {
            Vector3d middle = Vector3d::Zero();
            for (const int node : mesh.tets.col(e)) middle += 0.25 * mesh.nodes.col(node);
            if (middle.cwiseAbs().maxCoeff() < interface) mesh.labels[e] = 2;
        }
        for (auto X : mesh.nodes.colwise()) {
            const double shell = X.cwiseAbs().maxCoeff();
            if (shell == 0.0) {
                X = centre;
                continue;
            }
            const Vector3d direction = sphere_point(X / shell, rims);
            const Vector3d inner = centre + radius * std::min(1.0, shell / interface) * direction;
            const double outwards = std::max(0.0, shell - interface) / (1.0 - interface);
            X = (1.0 - outwards) * inner + outwards * direction.cwiseProduct(semi_axes);
        }
        return mesh;
    };
    problem.middle = [](const Vector3d& a, const Vector3d& b) {
        const auto on_ball = [](const Vector3d& X) { return near((X - centre).norm(), radius); };
        if (!on_ball(a) || !on_ball(b)) return surface_middle(a, b);
        return Vector3d(centre + radius * (0.5 * (a + b) - centre).normalized());
    };
    problem.hold = [](const Vector3d& X, int) {
        tled::PrescribedDisplacement held = held_patches(X);
        if (near(X[1], 0.0)) held.constrained[1] = true;
        return held;
    };
    return problem;
}

}  // namespace tissuewarp::verification
