// Figures of docs/decisions/hexahedra.md: the hourglass coefficient against references, by Newton's method.
//   hexahedra_table cantilever | cube
#include "meshing/hex_primitives.hpp"
#include "meshing/primitives.hpp"
#include "tled/blas_threads.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/reference/newton.hpp"

#include <array>
#include <cstdio>
#include <string>

namespace {

using namespace tissuewarp;
using Eigen::Vector3d;

constexpr std::array<double, 7> coefficients{0.01, 0.02, 0.04, 0.05, 0.07, 0.1, 0.2};

tled::Model box_model(const Vector3d& size, const std::array<int, 3>& cells, const tled::Material& material,
                      double coefficient) {
    tled::Model model;
    if (coefficient > 0.0) {
        const meshing::MixedMesh box = meshing::box_hexes(size, cells);
        model.mesh = box.mesh;
        model.hexahedra = box.hexahedra;
        model.hourglass_coefficient = coefficient;
    } else {
        model.mesh = meshing::box_mesh(size, cells);
    }
    model.materials[1] = material;
    return model;
}

/// Largest |q|/8 of a hexahedron over its edge: the relative displacement of neighbours in an hourglass pattern.
double hourglassing(const tled::RestState& rest, const Eigen::Matrix3Xd& u) {
    double largest = 0.0;
    for (int e = 0; e < rest.hexahedra.count(); ++e)
        for (const auto& base : tled::hourglass_base) {
            Vector3d q = Vector3d::Zero();
            for (int corner = 0; corner < 8; ++corner) q += base[corner] * u.col(rest.hexahedra.nodes(corner, e));
            largest = std::max(largest, q.norm() / 8 / std::cbrt(rest.hexahedra.volume[e]));
        }
    return largest;
}

/// Bar of 1000 × 250 × 250 mm under its own weight (data of p5_cantilever: the tip falls by 506.07 mm and comes back by
/// 141.32 mm, known to 0.4 mm), E = 400 kPa, ν = 0.45, iso law.
void cantilever(const std::array<int, 3>& cells, double coefficient) {
    const tled::Model model = box_model({1000, 250, 250}, cells, tled::neo_hookean_iso(400, 0.45), coefficient);
    const tled::RestState rest = tled::rest_state(model);
    tled::Conditions conditions;
    conditions.external_force = Eigen::Matrix3Xd::Zero(3, rest.node_count);
    Vector3d tip = Vector3d::Zero();
    int tip_node = -1;
    for (int node = 0; node < rest.node_count; ++node) {
        conditions.external_force(1, node) = -9810 * rest.lumped_mass[node];
        const Vector3d X = rest.position.col(node);
        if (X.x() < 1e-6) conditions.prescribed.push_back({node, {true, true, true}, Vector3d::Zero()});
        if ((X - Vector3d(1000, 125, 125)).norm() < 1e-6) tip_node = node;
    }
    tled::NewtonOptions options;
    options.tolerance_mm = 1e-4;
    options.load_steps = 8;
    const Eigen::Matrix3Xd u =
        tled::newton_equilibrium(rest, tled::nodal_conditions(conditions, rest.node_count), options).displacement;
    if (tip_node >= 0) {
        tip = u.col(tip_node);
    } else {  // one element across: the mean of the end face
        int count = 0;
        for (int node = 0; node < rest.node_count; ++node)
            if (rest.position(0, node) > 1000 - 1e-6) tip += u.col(node), ++count;
        tip /= count;
    }
    std::printf("| %d × %d × %d | %.3f | %.1f | %.1f | %.2f %% | %.3f |\n", cells[0], cells[1], cells[2], coefficient,
                tip.x(), tip.y(), 100 * (tip.y() / -506.065 - 1), hourglassing(rest, u));
    std::fflush(stdout);
}

/// The cube of 100 mm stretched by 20 % between bonded ends (p1_cube_stretch: 6085.2 mN, iso).
void cube(int cells, double coefficient) {
    const tled::Model model =
        box_model({100, 100, 100}, {cells, cells, cells}, tled::NeoHookeanIso{1.007, 50.000333}, coefficient);
    const tled::RestState rest = tled::rest_state(model);
    const int layer = (cells + 1) * (cells + 1);
    tled::Conditions conditions;
    for (int i = 0; i < layer; ++i) {
        conditions.prescribed.push_back({i, {true, true, true}, Vector3d::Zero()});
        conditions.prescribed.push_back({rest.node_count - layer + i, {true, true, true}, Vector3d(0, 0, 20)});
    }
    tled::NewtonOptions options;
    options.tolerance_mm = 1e-4;
    const Eigen::Matrix3Xd u =
        tled::newton_equilibrium(rest, tled::nodal_conditions(conditions, rest.node_count), options).displacement;
    const double force = tled::internal_force(rest, u).rightCols(layer).row(2).sum();
    const Vector3d side = u.col(cells + (cells + 1) * (cells / 2 + (cells + 1) * (cells / 2)));
    std::printf("| %d | %.3f | %.1f | %.2f %% | %.3f | %.3f |\n", cells, coefficient, force, 100 * (force / 6085.2 - 1),
                side.x(), hourglassing(rest, u));
    std::fflush(stdout);
}

}  // namespace

int main(int count, char** arguments) {
    tissuewarp::tled::let_solves_take_one_blas_thread(true);
    const std::string study = count > 1 ? arguments[1] : "cantilever";
    std::printf("coefficient 0: averaged-pressure tetrahedra, six to a cell\n");
    if (study == "cantilever") {
        std::printf("| cells | c | tip x, mm | tip y, mm | error | hourglassing |\n|---|---|---|---|---|---|\n");
        for (const std::array<int, 3> cells : {std::array{4, 1, 1}, {8, 2, 2}, {16, 4, 4}, {8, 4, 4}, {24, 6, 6}}) {
            cantilever(cells, 0.0);
            for (const double c : coefficients) cantilever(cells, c);
        }
    } else {
        std::printf(
            "| cells | c | force, mN | error | side, mm (−5.371) | hourglassing |\n|---|---|---|---|---|---|\n");
        for (const int cells : {4, 8, 12, 16}) {
            cube(cells, 0.0);
            for (const double c : coefficients) cube(cells, c);
        }
    }
}
