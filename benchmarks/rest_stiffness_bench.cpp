// Seconds to make, to factorise and to solve with the stiffness at rest, and for what does without a factor: boxes of
// Kuhn tetrahedra, E = 3 kPa, ν = 0.49, springs on the whole boundary, as a registration has them. See
// docs/decisions/rest_stiffness.md.
//     rest_stiffness_bench [--without-factor] [cells an edge ...; default 16 20 24 27]

#include "meshing/primitives.hpp"
#include "tled/blas_threads.hpp"
#include "tled/model.hpp"
#include "tled/stiffness/rest_stiffness.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
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

/// The problem, and the same with every third spring ten times weaker, as after a rematch that takes outliers back.
struct Box {
    tled::RestState rest;
    tled::NodalConditions conditions, other;
};

Box box_of(int cells, tled::Element element) {
    tled::Model model;
    model.mesh = meshing::box_mesh(Eigen::Vector3d::Constant(edge_mm), {cells, cells, cells}, 0.15, 1);
    model.materials[1] = tled::neo_hookean_lnj(3.0, 0.49);
    model.element = element;
    const tled::RestState rest = tled::rest_state(model);
    tled::Conditions conditions = boundary_springs(model.mesh, 1000.0 / (cells * cells));
    const auto factorised = tled::nodal_conditions(conditions, rest.node_count);
    for (std::size_t s = 0; s < conditions.springs.size(); s += 3) conditions.springs[s].stiffness *= 0.1;
    return {rest, factorised, tled::nodal_conditions(conditions, rest.node_count)};
}

void measure_factor(const tled::RestStiffness& stiffness, const Box& box) {
    const double analyse = seconds([&] { stiffness.analyse(); });
    const double factorise = seconds([&] { stiffness.factorise(); });
    constexpr int repeats = 5;
    const Eigen::Matrix3Xd force = Eigen::Matrix3Xd::Random(3, box.rest.node_count);
    const double solve = seconds([&] {
                             for (int k = 0; k < repeats; ++k) static_cast<void>(stiffness.solve(force));
                         }) /
                         repeats;
    const double loose = seconds([&] { static_cast<void>(stiffness.solve(force, box.other, 1e-2)); });
    const double tight = seconds([&] { static_cast<void>(stiffness.solve(force, box.other, 1e-8)); });
    double value = 0;
    const double lowest = seconds([&] { value = stiffness.lowest_eigenvalue(); });
    std::printf(" %.1f | %.2f | %.2f | %.3f | %.2f | %.2f | %.2f: %.3g |",
                1e-6 * static_cast<double>(stiffness.factor_nonzeros()), analyse, factorise, solve, loose, tight,
                lowest, value);
}

void measure(int cells, tled::Element element, bool with_factor) {
    const Box box = box_of(cells, element);
    std::unique_ptr<tled::RestStiffness> stiffness;
    const double construct =
        seconds([&] { stiffness = std::make_unique<tled::RestStiffness>(box.rest, box.conditions); });
    double value = 0;
    const double lowest = seconds([&] { value = stiffness->approximate_lowest_eigenvalue(); });
    const tled::RestStiffness held_otherwise(box.rest, box.other, *stiffness);
    double other_value = 0;
    const double other_lowest = seconds([&] { other_value = held_otherwise.approximate_lowest_eigenvalue(); });
    std::printf("| %d | %s | %.2f | %.3f: %.3g | %.3f: %.3g |", box.rest.element_count(),
                element == tled::Element::T4 ? "T4" : "averaged pressure", construct, lowest, value, other_lowest,
                other_value);
    if (with_factor) measure_factor(*stiffness, box);
    std::printf("\n");
    std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
    tissuewarp::tled::let_solves_take_one_blas_thread(true);
    std::vector<int> cells{16, 20, 24, 27};
    const bool with_factor = argc < 2 || std::strcmp(argv[1], "--without-factor") != 0;
    const int first = with_factor ? 1 : 2;
    if (argc > first) cells.assign(argc - first, 0);
    for (int k = first; k < argc; ++k) cells[static_cast<std::size_t>(k - first)] = std::atoi(argv[k]);
    std::printf("| tetrahedra | element | construct, s | lowest eigenvalue about, s: λ | with other springs, s: λ |");
    if (with_factor)
        std::printf(
            " factor, 10⁶ entries | analyse, s | factorise, s | solve, s | other springs to 1e-2, s | to 1e-8, s | "
            "lowest eigenvalue, s: λ |");
    std::printf(with_factor ? "\n|---|---|---|---|---|---|---|---|---|---|---|---|\n" : "\n|---|---|---|---|---|\n");
    for (int n : cells) {
        measure(n, tled::Element::T4, with_factor);
        measure(n, tled::Element::AveragedPressureT4, with_factor);
    }
    return 0;
}
