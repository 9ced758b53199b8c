// Prints the table of docs/lab/performance.md, section "Error of the mesh": what its estimate costs beside a factor and an
// equilibrium. Cube of 100 mm, jittered, bottom held, a part of its top pushed in by 8 mm.
//     discretisation_bench [CELLS]

#include "meshing/primitives.hpp"
#include "tled/blas_threads.hpp"
#include "tled/equilibrium.hpp"
#include "tled/error/discretisation_error.hpp"
#include "tled/rest_state.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>

using namespace tissuewarp;
using namespace tissuewarp::tled;

namespace {

/// Seconds since its construction: on the wall, and of all threads together.
struct Watch {
    std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
    std::clock_t cpu = std::clock();

    [[nodiscard]] double wall() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    }
    [[nodiscard]] double threads() const { return static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC; }
};

NodalConditions pushed(const meshing::TetMesh& mesh) {
    Conditions conditions;
    for (int i = 0; i < mesh.node_count(); ++i) {
        const Eigen::Vector3d X = mesh.nodes.col(i);
        if (X[2] < 1e-9) conditions.prescribed.push_back({i, {true, true, true}, Eigen::Vector3d::Zero()});
        if (X[2] > 100.0 - 1e-9 && X[0] < 60.0) conditions.prescribed.push_back({i, {true, true, true}, {3, 0, -8}});
    }
    return nodal_conditions(conditions, mesh.node_count());
}

void print_row(int cells, double nu) {
    Model model;
    model.mesh = meshing::box_mesh({100.0, 100.0, 100.0}, {cells, cells, cells}, 0.1, 7);
    model.materials[1] = neo_hookean_iso(3.0, nu);
    model.element = suggested_element(model.materials);
    const RestState rest = rest_state(model);
    const NodalConditions conditions = pushed(model.mesh);
    const Watch factor;
    const RestStiffness stiffness(rest, conditions);
    const double factor_wall = factor.wall(), factor_threads = factor.threads();
    const auto engine = make_cpu_engine(rest);
    const Watch search;
    const Eigen::Matrix3Xd u = equilibrium(*engine, stiffness, conditions).displacement;
    const double search_wall = search.wall(), search_threads = search.threads();
    const Watch estimate;
    const DiscretisationEstimate found = discretisation_error(model, stiffness, conditions, u);
    const double estimate_wall = estimate.wall(), estimate_threads = estimate.threads();
    std::printf("| %d | %g | %.2f (%.2f) | %.2f (%.2f) | %.2f (%.2f) | ", model.mesh.tet_count(), nu, factor_wall,
                factor_threads, search_wall, search_threads, estimate_wall, estimate_threads);
    if (found.error) {
        std::printf("%d | %.2f |\n", found.error->iterations, found.error->corner.colwise().norm().maxCoeff());
    } else {
        std::printf("%s |\n", found.reason.c_str());
    }
    std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
    tissuewarp::tled::let_solves_take_one_blas_thread(true);
    std::printf(
        "| tetrahedra | ν | factor, s (of all threads) | equilibrium | estimate | iterations | largest error, mm |\n"
        "|---|---|---|---|---|---|---|\n");
    for (const double nu : {0.3, 0.45, 0.49}) print_row(argc == 2 ? std::atoi(argv[1]) : 20, nu);
    return 0;
}
