// Force evaluations and seconds to a given displacement error, by each method, on the three cubes of a
// brain-retraction-like load: 100 mm cube, averaged-pressure T4, lnJ law, E = 3 kPa, interior nodes jittered by 0.2
// cell, bottom held within 25 mm of its centre, a cap of 35 mm radius on top pushed 12 mm down and 6 mm sideways.
//     equilibrium_bench [--cells 16|24|12] [--gpu] [--runs N] [tolerance_mm ...]

#include "meshing/primitives.hpp"
#include "tled/blas_threads.hpp"
#include "tled/equilibrium.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/reference/newton.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>

using namespace tissuewarp;
using Eigen::Matrix3Xd;

namespace {

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double largest_norm(const Matrix3Xd& vectors) {
    return std::sqrt(vectors.colwise().squaredNorm().maxCoeff());
}

tled::Conditions retraction(const meshing::TetMesh& mesh) {
    tled::Conditions conditions;
    for (int node = 0; node < mesh.node_count(); ++node) {
        const Eigen::Vector3d x = mesh.nodes.col(node);
        const double r = std::hypot(x[0] - 50, x[1] - 50);
        if (x[2] < 1e-6 && r <= 25) conditions.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
        if (x[2] > 100 - 1e-6 && r <= 35) {
            const double w = 0.5 + 0.5 * std::cos(EIGEN_PI * r / 35);
            conditions.prescribed.push_back({node, {true, true, true}, {6 * w, 0, -12 * w}});
        }
    }
    return conditions;
}

/// Passes everything on, counts force evaluations and records the true error of every displacement whose force was
/// evaluated.
class Watched final : public tled::Engine {
public:
    Watched(tled::Engine& engine, const Matrix3Xd& exact) : engine_(engine), exact_(exact) {}

    void set_conditions(const tled::NodalConditions& conditions) override { engine_.set_conditions(conditions); }
    void set_mass(const Matrix3Xd& mass) override { engine_.set_mass(mass); }
    void set_state(const Matrix3Xd& u, const Matrix3Xd& v) override { engine_.set_state(u, v); }
    void set_increment(const Matrix3Xd& v) override { engine_.set_increment(v); }
    void keep_state() override { engine_.keep_state(); }
    void return_to_kept_state() override { engine_.return_to_kept_state(); }
    void run(int steps, const tled::StepCoefficients& coefficients) override {
        for (int step = 0; step < steps; ++step) {
            engine_.run(1, coefficients);
            record();
        }
    }
    [[nodiscard]] Matrix3Xd displacement() const override { return engine_.displacement(); }
    [[nodiscard]] Matrix3Xd increment() const override { return engine_.increment(); }
    [[nodiscard]] Matrix3Xd residual() override {
        record();
        return engine_.residual();
    }
    [[nodiscard]] Matrix3Xd internal_force() override {
        record();
        return engine_.internal_force();
    }
    [[nodiscard]] tled::Observation observe() override {
        record();
        record();
        return engine_.observe();
    }
    [[nodiscard]] tled::SmallestJacobian smallest_jacobian() override { return engine_.smallest_jacobian(); }
    [[nodiscard]] tled::CheckedDisplacement run_and_check(std::span<const tled::Steps> steps) override {
        for (const tled::Steps& each : steps) run(each.count, each.coefficients);
        return engine_.run_and_check({});
    }
    [[nodiscard]] bool admits_inversion() const override { return engine_.admits_inversion(); }
    [[nodiscard]] std::vector<tled::StepPass> step_passes() override { return engine_.step_passes(); }
    [[nodiscard]] std::string description() const override { return engine_.description(); }
    [[nodiscard]] tled::Processor processor() const override { return engine_.processor(); }
    [[nodiscard]] double precision() const override { return engine_.precision(); }

    /// Evaluations until the error stayed below the limit.
    [[nodiscard]] int evaluations_to(double limit) const {
        const auto above =
            std::find_if(error_.rbegin(), error_.rend(), [&](double error) { return !(error <= limit); });
        return above == error_.rbegin() ? -1 : static_cast<int>(error_.rend() - above) + 1;
    }
    [[nodiscard]] int evaluations() const { return static_cast<int>(error_.size()); }

private:
    void record() { error_.push_back(largest_norm(engine_.displacement() - exact_)); }

    tled::Engine& engine_;
    const Matrix3Xd& exact_;
    std::vector<double> error_;
};

struct Row {
    const char* name;
    tled::EquilibriumMethod method;
    bool refreshed;
};
constexpr Row rows[] = {{"L-BFGS, metric K0", tled::EquilibriumMethod::Lbfgs, false},
                        {"L-BFGS, metric renewed", tled::EquilibriumMethod::Lbfgs, true},
                        {"dynamic relaxation", tled::EquilibriumMethod::DynamicRelaxation, false},
                        {"self-checked relaxation", tled::EquilibriumMethod::SelfCheckedRelaxation, false},
                        {"automatic", tled::EquilibriumMethod::Automatic, false}};

struct Cube {
    tled::RestState rest;
    tled::NodalConditions conditions;
    std::optional<tled::RestStiffness> stiffness;
    Matrix3Xd exact;
};

Cube make_cube(int cells, double poisson) {
    tled::Model model;
    model.mesh = meshing::box_mesh({100, 100, 100}, {cells, cells, cells}, 0.2, 1);
    model.materials[1] = tled::neo_hookean_lnj(3.0, poisson);
    model.element = tled::Element::AveragedPressureT4;
    Cube cube;
    cube.rest = tled::rest_state(model);
    cube.conditions = tled::nodal_conditions(retraction(model.mesh), cube.rest.node_count);
    double start = now();
    cube.stiffness.emplace(cube.rest, cube.conditions);
    const double factor_seconds = now() - start;
    start = now();
    const double lowest = cube.stiffness->lowest_eigenvalue();
    std::printf("\ncube n=%d nu=%g: %d T4, factor %.2f s, lowest eigenvalue %.2g in %.2f s", cells, poisson,
                cube.rest.element_count(), factor_seconds, lowest, now() - start);
    start = now();
    cube.exact = tled::newton_equilibrium(cube.rest, cube.conditions, {.tolerance_mm = 1e-6}).displacement;
    std::printf(", Newton %.1f s, min J %.3f\n", now() - start, tled::jacobians(cube.rest, cube.exact).minCoeff());
    return cube;
}

/// One row of the table: counts with the error watched, seconds without.
void measure(const Cube& cube, tled::Engine& engine, const Row& row, double tolerance, int runs) {
    tled::EquilibriumOptions options{.tolerance_mm = tolerance, .max_steps = 20000, .method = row.method};
    if (row.refreshed) options.rest = &cube.rest;
    try {
        double seconds = 1e300;
        for (int run = 0; run < runs; ++run) {
            const double start = now();
            (void)tled::equilibrium(engine, *cube.stiffness, cube.conditions, options);
            seconds = std::min(seconds, now() - start);
        }
        Watched watched(engine, cube.exact);
        const auto found = tled::equilibrium(watched, *cube.stiffness, cube.conditions, options);
        const double error = largest_norm(found.displacement - cube.exact);
        std::printf("  %-22s %-7g %8d %8d %7d %8.2f %9.4f %9.4f %8.2f  %s\n", row.name, tolerance,
                    watched.evaluations_to(tolerance), watched.evaluations(), found.lifted_residuals, seconds, error,
                    found.estimated_error_mm, found.estimated_error_mm / error, tled::name_of(found.method));
    } catch (const Error& error) {
        std::printf("  %-22s %-7g %s\n", row.name, tolerance, error.what());
    }
    std::fflush(stdout);
}

void solve_cube(int cells, double poisson, const std::vector<double>& tolerances, bool gpu, int runs) {
    const Cube cube = make_cube(cells, poisson);
    std::vector<std::unique_ptr<tled::Engine>> engines;
    engines.push_back(tled::make_cpu_engine(cube.rest, tled::Scalar::Float64));
    engines.push_back(tled::make_cpu_engine(cube.rest, tled::Scalar::Float32));
    if (gpu) engines.push_back(tled::make_gpu_engine(cube.rest));
    for (const auto& engine : engines) {
        std::printf(" %s\n  %-22s %-7s %8s %8s %7s %8s %9s %9s %8s\n", engine->description().c_str(), "method",
                    "tol mm", "to true", "evals", "solves", "seconds", "true mm", "est. mm", "effect.");
        for (const Row& row : rows)
            for (const double tolerance : tolerances) measure(cube, *engine, row, tolerance, runs);
    }
}

}  // namespace

int main(int argc, char** argv) {
    tissuewarp::tled::let_solves_take_one_blas_thread(true);
    std::vector<double> tolerances;
    bool gpu = false;
    int only = 0, runs = 3;
    for (int i = 1; i < argc; ++i) {
        if (std::strcmp(argv[i], "--gpu") == 0)
            gpu = true;
        else if (std::strcmp(argv[i], "--cells") == 0 && i + 1 < argc)
            only = std::atoi(argv[++i]);
        else if (std::strcmp(argv[i], "--runs") == 0 && i + 1 < argc)
            runs = std::atoi(argv[++i]);
        else
            tolerances.push_back(std::atof(argv[i]));
    }
    if (tolerances.empty()) tolerances = {0.1, 0.01};
    for (const auto& [cells, poisson] : {std::pair{16, 0.49}, {24, 0.49}, {12, 0.499}})
        if (only == 0 || only == cells) solve_cube(cells, poisson, tolerances, gpu, runs);
}
