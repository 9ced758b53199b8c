// p1, p2: the cube of the seed method between bonded plates.

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

constexpr double edge = 100.0, half = 50.0, on_plane = 1e-9;  // mm

// Points within 20 mm of the bonded faces are left out where their edges fold.
std::function<bool(const Vector3d&)> away_from_plates(double margin) {
    return [margin](const Vector3d& X) { return X[2] >= margin - on_plane && X[2] <= edge - margin + on_plane; };
}

// Displacement of the whole cube from its eighth [0, 50]³ with the plate at z = 0 and the others symmetry planes.
Vector3d unfold_eighth(const Solution& s, const Vector3d& X, double top) {
    Vector3d folded = X, sign = Vector3d::Ones();
    for (int c = 0; c < 3; ++c) {
        if (X[c] <= half) continue;
        folded[c] = edge - X[c];
        sign[c] = -1.0;
    }
    Vector3d u = sign.cwiseProduct(s.at(folded));
    if (sign[2] < 0.0) u[2] += top;
    return u;
}

// Tension or compression by `top` mm.
Problem axial(const std::string& name, Law law, double top, double grading, double margin) {
    const json file = reference_file(name);
    const json& values = values_of(file, law);
    Problem problem;
    problem.name = name;
    problem.law = law;
    problem.materials[1] = material_of(file, law);
    problem.mesh = [grading](int cells) {
        const std::vector<double> x = graded(half, cells, grading);
        return meshing::box_mesh({x, x, x});
    };
    problem.hold = [top](const Vector3d& X, int) {
        tled::PrescribedDisplacement held;
        const bool plate = near(X[2], 0.0);
        held.constrained = {plate || near(X[0], half), plate || near(X[1], half), plate || near(X[2], half)};
        if (near(X[2], half)) held.displacement[2] = 0.5 * top;
        return held;
    };
    const auto force = [](const Solution& s) {
        return 4.0 * s.reaction([](const Vector3d& X) { return near(X[2], half); })[2];
    };
    problem.quantities = {
        component_quantity("force z", "mN", values.at("force"), 0, mN_per_N, force), energy_quantity(values, 8.0),
        point_quantity(file.at("points"), values.at("u"), away_from_plates(margin),
                       [top](const Solution& s, const Vector3d& X) { return unfold_eighth(s, X, top); })};
    return problem;
}

}  // namespace

Problem cube_stretch(Law law) {
    Problem problem = axial("p1_cube_stretch", law, 20.0, 2.0, 0.0);
    problem.levels = {8, 12, 15, 18};
    problem.quadratic_levels = {2, 4, 6, 8};
    return problem;
}

Problem cube_mild_compression(Law law) {
    Problem problem = axial("p2_cube_compress_mild", law, -15.0, 1.6, 20.0);
    problem.levels = {8, 12, 15, 18};
    problem.quadratic_levels = {2, 4, 6, 8};
    return problem;
}

Problem cube_compression(Law law) {
    Problem problem = axial("p2_cube_compress", law, -30.0, 1.0, 20.0);
    problem.levels = {4, 6, 7, 9};
    problem.quadratic_levels = {1, 2, 3, 4};
    return problem;
}

Problem cube_shear(Law law) {
    const json file = reference_file("p2_cube_shear");
    const json& values = values_of(file, law);
    Problem problem;
    problem.name = "p2_cube_shear";
    problem.law = law;
    problem.materials[1] = material_of(file, law);
    problem.mesh = [](int cells) {
        const std::vector<double> x = graded_both_ways(edge, 2 * cells, 1.8);
        return meshing::box_mesh({x, graded(half, cells, 1.8), x});
    };
    problem.hold = [](const Vector3d& X, int) {
        tled::PrescribedDisplacement held;
        const bool top = near(X[2], edge), plate = top || near(X[2], 0.0);
        held.constrained = {plate, plate || near(X[1], half), plate};
        if (top) held.displacement[0] = 50.0;
        return held;
    };
    const auto force = [](int component) {
        return [component](const Solution& s) {
            return 2.0 * s.reaction([](const Vector3d& X) { return near(X[2], edge); })[component];
        };
    };
    const auto whole = [](const Solution& s, const Vector3d& X) {
        if (X[1] <= half) return s.at(X);
        const Vector3d u = s.at({X[0], edge - X[1], X[2]});
        return Vector3d(u[0], -u[1], u[2]);
    };
    problem.quantities = {component_quantity("force x", "mN", values.at("force"), 0, mN_per_N, force(0)),
                          component_quantity("force z", "mN", values.at("force"), 1, mN_per_N, force(2)),
                          energy_quantity(values, 2.0),
                          point_quantity(file.at("points"), values.at("u"), away_from_plates(20.0), whole)};
    problem.levels = {4, 6, 7, 9};
    problem.quadratic_levels = {1, 2, 3, 4};
    return problem;
}

}  // namespace tissuewarp::verification
