// Fibres whose direction varies in space, by whole scenes.
#include "tests/verification/effect_cases.hpp"
#include "tests/verification/effect_column.hpp"
#include "tests/verification/effect_scene_end.hpp"

#include "meshing/primitives.hpp"
#include "simulation/build.hpp"
#include "simulation/run.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::verification {
namespace {

using namespace effects;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using simulation::BuiltScene;
using simulation::Curve;
using simulation::Scene;

/// ∫ f over [from, to] by Simpson's rule.
template <class Function>
double integral(double from, double to, const Function& f) {
    constexpr int parts = 400;
    const double h = (to - from) / parts;
    double sum = f(from) + f(to);
    for (int i = 1; i < parts; ++i) sum += (i % 2 == 0 ? 2 : 4) * f(from + h * i);
    return sum * h / 3;
}

// A column that can only move along z, drawn at its top, whose fibres run along it in the lower half and across it, by
// turns, in the upper one: the stress is the same everywhere, and each slice is in uniaxial strain F = diag(1, 1, λ) by
// its own angle θ to the fibres, of which neither drags the column's sides along. Ī₁ = λ^(−2/3) (2 + λ²),
// Ī₄ = λ^(−2/3) (sin² θ + λ² cos² θ), P = dW/dλ.
constexpr double column_pull = 2.0;  // kPa
const tled::TransverselyIsotropic column_law{1.0, 8.0, 4.0, Vector3d::UnitX()};
double slice_stress(double stretch, double angle) {
    const double s = std::pow(std::sin(angle), 2), c = std::pow(std::cos(angle), 2), root = std::cbrt(stretch);
    const double I4 = (s + stretch * stretch * c) / (root * root);
    const double slope_of_I4 = -2.0 / 3 * s / (root * root * stretch) + 4.0 / 3 * root * c;
    return column_law.shear_modulus / 2 * 4.0 / 3 * (root - 1 / (root * root * stretch)) +
           column_law.fibre_modulus * (I4 - 1) * slope_of_I4 + column_law.bulk_modulus * (stretch - 1);
}
double slice_stretch(double stress, double angle) {
    double low = 0.5, high = 2.0;
    for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (slice_stress(middle, angle) < stress ? low : high) = middle;
    }
    return 0.5 * (low + high);
}
double elongation() {
    return length / 2 * (slice_stretch(column_pull, 0) + slice_stretch(column_pull, M_PI / 2)) - length;
}
double measured_elongation(const MakeEngine& make) {
    Scene scene;
    scene.title = "column of fibres along and across";
    const meshing::TetMesh mesh = meshing::box_mesh({side, side, length}, {1, 1, 50});
    Matrix3Xd directions(3, mesh.tet_count());
    for (int e = 0; e < mesh.tet_count(); ++e) {
        const double z = mesh.nodes(Eigen::all, mesh.tets.col(e)).row(2).mean();
        if (z < length / 2)
            directions.col(e) = Vector3d::UnitZ();
        else
            directions.col(e) << std::cos(z), std::sin(z), 0;
    }
    scene.geometry = mesh;
    scene.tissues[1].material = column_law;
    scene.tissues[1].fibres = simulation::FibresOfTetrahedra{directions};
    scene.sets["all"] = {};
    scene.sets["base"].side = simulation::Side{2, false, 0.0};
    scene.sets["top"].side = simulation::Side{2, true, 0.0};
    scene.fixed.push_back({"all", {true, true, false}});
    scene.fixed.push_back({"base", {false, false, true}});
    scene.pressures.push_back({"top", -column_pull, Curve{}});
    scene.solve.element = tled::Element::T4;
    scene.solve.tolerance_mm = 1e-3;
    const BuiltScene built = simulation::build(scene);
    const Matrix3Xd u = end_of(built, make);
    double sum = 0;
    int count = 0;
    for (int a = 0; a < built.mesh.node_count(); ++a)
        if (on_top(built.mesh.nodes.col(a))) {
            sum += u(2, a);
            ++count;
        }
    return sum / count;
}

// A quarter of a tube, A ≤ R ≤ B, of nearly incompressible material with fibres around it, inflated from inside in
// plane strain. The incompressible tube has b² − a² = B² − A², λ = r/R around and 1/λ along the radius, energy W(λ) =
// μ/2 (λ² + λ⁻² − 2) + η/2 (λ² − 1)², and p = ∫ λ W'(λ) dr/r over the wall.
constexpr double tube_inner = 10.0, tube_outer = 16.0, tube_height = 1.5, tube_stretch = 1.25;
const tled::TransverselyIsotropic tube_law{1.0, 1000.0, 0.8, Vector3d::UnitZ()};
double tube_pressure() {
    const double a = tube_stretch * tube_inner,
                 b = std::sqrt(a * a + tube_outer * tube_outer - tube_inner * tube_inner);
    return integral(a, b, [&](double r) {
        const double stretch = r / std::sqrt(r * r - a * a + tube_inner * tube_inner);
        const double slope = tube_law.shear_modulus * (stretch - std::pow(stretch, -3)) +
                             2 * tube_law.fibre_modulus * (stretch * stretch - 1) * stretch;
        return stretch * slope / r;
    });
}
meshing::TetMesh tube() {
    meshing::TetMesh mesh = meshing::box_mesh({1, 1, tube_height}, {8, 20, 1});
    for (auto X : mesh.nodes.colwise()) {
        const double R = tube_inner + (tube_outer - tube_inner) * X[0], angle = M_PI / 2 * X[1];
        X.head<2>() << R * std::cos(angle), R * std::sin(angle);
    }
    return mesh;
}
/// Around z on voxels of a millimetre.
simulation::FibreVolume around_z() {
    imaging::Geometry grid;
    grid.size = {20, 20, 4};
    grid.spacing.setOnes();
    grid.origin = {-1.5, -1.5, -1};
    imaging::Volume volume(grid, CV_32FC3);
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                const Vector3d x = grid.point({double(i), double(j), double(k)});
                volume.data<cv::Vec3f>()[volume.offset(i, j, k)] = {float(-x[1]), float(x[0]), 0.0F};
            }
    return {volume};
}
double measured_tube_radius(const MakeEngine& make) {
    Scene scene;
    scene.title = "tube";
    scene.geometry = tube();
    scene.tissues[1].material = tube_law;
    scene.tissues[1].fibres = around_z();
    scene.sets["all"] = {};
    scene.sets["on x"].side = simulation::Side{1, false, 0.0};
    scene.sets["on y"].side = simulation::Side{0, false, 0.0};
    const double reach = std::hypot(tube_inner, tube_height / 2) * (1 + 1e-9);
    scene.sets["inside"].ball = simulation::Ball{{0, 0, tube_height / 2}, reach};
    scene.fixed.push_back({"all", {false, false, true}});
    scene.fixed.push_back({"on x", {false, true, false}});
    scene.fixed.push_back({"on y", {true, false, false}});
    scene.pressures.push_back({"inside", tube_pressure(), Curve{}});
    scene.solve.element = tled::Element::AveragedPressureT4;
    scene.solve.tolerance_mm = 0.01;
    const BuiltScene built = simulation::build(scene);
    const Matrix3Xd& X = built.mesh.nodes;
    const Matrix3Xd x = X + end_of(built, make);
    double sum = 0;
    int count = 0;
    for (int a = 0; a < X.cols(); ++a)
        if (X.col(a).head<2>().norm() < tube_inner * (1 + 1e-9)) {
            sum += x.col(a).head<2>().norm();
            ++count;
        }
    return sum / count;
}

}  // namespace

std::vector<EffectCase> fibre_cases() {
    return {
        {"fibres that vary", "column of fibres along and across", "elongation", "mm", "L/2 (λ(P, 0) + λ(P, π/2)) − L",
         elongation(), 2e-3, measured_elongation},
        {"fibres that vary", "tube with fibres around it, inflated by 1.25", "inner radius", "mm",
         "quadrature of λ W'(λ)/r", tube_stretch * tube_inner, 0.02, measured_tube_radius},
    };
}

}  // namespace tissuewarp::verification
