// Seconds to factorise and to solve with the stiffness at rest: boxes of Kuhn tetrahedra, E = 3 kPa, ν = 0.49, springs
// on the whole boundary, as a registration has them. See docs/decisions/rest_stiffness.md.
//     rest_stiffness_bench [cells an edge ...; default 16 20 24 27]

#include "meshing/primitives.hpp"
#include "tled/model.hpp"
#include "tled/rest_stiffness.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

using namespace tissuewarp;

namespace {

constexpr double edge_mm = 100.0;

template <typename Work>
double seconds(const Work& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

tled::Conditions boundary_springs(const meshing::TetMesh& mesh, double stiffness_mN_per_mm) {
    tled::Conditions conditions;
    for (int i = 0; i < mesh.node_count(); ++i) {
        const Eigen::Vector3d x = mesh.nodes.col(i);
        if (x.minCoeff() > 1e-9 && x.maxCoeff() < edge_mm - 1e-9) continue;
        conditions.springs.push_back({i, stiffness_mN_per_mm * Eigen::Matrix3d::Identity(), {0, 0, -0.05 * x.z()}});
    }
    return conditions;
}

void measure(int cells, tled::Element element) {
    tled::Model model;
    model.mesh = meshing::box_mesh(Eigen::Vector3d::Constant(edge_mm), {cells, cells, cells}, 0.15, 1);
    model.materials[1] = tled::neo_hookean_lnj(3.0, 0.49);
    model.element = element;
    const tled::RestState rest = tled::rest_state(model);
    tled::Conditions conditions = boundary_springs(model.mesh, 1000.0 / (cells * cells));
    const auto factorised = tled::nodal_conditions(conditions, rest.node_count);
    // Every third spring ten times weaker, as after a rematch that takes outliers back.
    for (std::size_t s = 0; s < conditions.springs.size(); s += 3) conditions.springs[s].stiffness *= 0.1;
    const auto other = tled::nodal_conditions(conditions, rest.node_count);

    std::unique_ptr<tled::RestStiffness> stiffness;
    const double construct = seconds([&] { stiffness = std::make_unique<tled::RestStiffness>(rest, factorised); });
    constexpr int repeats = 5;
    const Eigen::Matrix3Xd force = Eigen::Matrix3Xd::Random(3, rest.node_count);
    const double solve = seconds([&] {
                             for (int k = 0; k < repeats; ++k) static_cast<void>(stiffness->solve(force));
                         }) /
                         repeats;
    const double loose = seconds([&] { static_cast<void>(stiffness->solve(force, other, 1e-2)); });
    const double tight = seconds([&] { static_cast<void>(stiffness->solve(force, other, 1e-8)); });
    const double lowest = seconds([&] { static_cast<void>(stiffness->lowest_eigenvalue()); });
    std::printf("| %d | %s | %.1f | %.2f | %.3f | %.2f | %.2f | %.2f |\n", rest.element_count(),
                element == tled::Element::T4 ? "T4" : "averaged pressure",
                1e-6 * static_cast<double>(stiffness->factor_nonzeros()), construct, solve, loose, tight, lowest);
    std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
    std::vector<int> cells{16, 20, 24, 27};
    if (argc > 1) {
        cells.clear();
        for (int k = 1; k < argc; ++k) cells.push_back(std::atoi(argv[k]));
    }
    std::printf(
        "| tetrahedra | element | factor, 10⁶ entries | construct, s | solve, s | other springs to 1e-2, s | "
        "to 1e-8, s | lowest eigenvalue, s |\n|---|---|---|---|---|---|---|---|\n");
    for (int n : cells) {
        measure(n, tled::Element::T4);
        measure(n, tled::Element::AveragedPressureT4);
    }
    return 0;
}
