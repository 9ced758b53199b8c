#include "benchmarks/verification_engines.hpp"

#include "core/errors.hpp"
#include "tests/verification/problems.hpp"
#include "tests/verification/solution.hpp"
#include "tled/equilibrium.hpp"
#include "tled/reference/newton.hpp"

#include <cmath>
#include <cstdio>

namespace tissuewarp::verification {

namespace {

using Eigen::Matrix3Xd;

struct Case {
    Problem problem;
    int level;
};

void print_engine(const Problem& problem, Elements elements, tled::Engine& engine, const tled::RestStiffness& stiffness,
                  const tled::NodalConditions& conditions, const Matrix3Xd& newton, double tolerance_mm) {
    const double largest = std::sqrt(newton.colwise().squaredNorm().maxCoeff());
    std::printf("| %s | %s | %s | %d | %s | ", problem.name.c_str(), name_of(problem.law), name_of(elements),
                static_cast<int>(newton.cols()), engine.description().c_str());
    try {
        const tled::EquilibriumResult found =
            tled::equilibrium(engine, stiffness, conditions, {.tolerance_mm = tolerance_mm, .max_steps = 60000});
        const double difference = std::sqrt((found.displacement - newton).colwise().squaredNorm().maxCoeff());
        std::printf("%.2g | %.2g | %.2g | %d |\n", largest, difference, difference / largest, found.force_evaluations);
    } catch (const SolverFailure& failure) {
        std::printf("%.2g | – | – | %s |\n", largest, failure.what());
    }
    std::fflush(stdout);
}

void print_case(const Case& each, Elements elements, GpuRows gpu) {
    const meshing::TetMesh mesh = each.problem.mesh(each.level);
    const tled::RestState rest = tled::rest_state(linear_model(each.problem, elements, mesh));
    const tled::NodalConditions conditions = nodal_conditions_of(each.problem, mesh);
    const Matrix3Xd newton = tled::newton_equilibrium(rest, conditions).displacement;
    const tled::RestStiffness stiffness(rest, conditions);
    constexpr double fine_mm = 1e-7, single_mm = 1e-3;
    const auto print = [&](std::unique_ptr<tled::Engine> engine, double tolerance_mm) {
        print_engine(each.problem, elements, *engine, stiffness, conditions, newton, tolerance_mm);
    };
    print(tled::make_cpu_engine(rest, tled::Scalar::Float64), fine_mm);
    print(tled::make_cpu_engine(rest, tled::Scalar::Float32), single_mm);
    if (gpu == GpuRows::Print) print(tled::make_gpu_engine(rest), single_mm);
}

}  // namespace

void print_engines(GpuRows gpu) {
    std::printf(
        "\n| problem | law | element | nodes | engine | largest displacement, mm | largest difference, mm | relative | "
        "force evaluations |\n|---|---|---|---|---|---|---|---|---|\n");
    const std::vector<Case> cases{{cube_stretch(Law::Iso), 6},
                                  {cube_stretch(Law::LnJ), 6},
                                  {cube_mild_compression(Law::Iso), 6},
                                  {cook_3d(Law::Iso, 0.49).value(), 8},
                                  {breast(Law::LnJ, Gravity::Supine), 6}};
    for (const Case& each : cases) {
        for (const Elements elements : {Elements::T4, Elements::AveragedPressure}) {
            print_case(each, elements, gpu);
        }
    }
}

}  // namespace tissuewarp::verification
