// Force evaluations and seconds to a given displacement error on the three cubes of a brain-retraction-like load: 100
// mm cube, bottom held within 25 mm of its centre, a cap of 35 mm radius on top pushed 12 mm down and 6 mm sideways.
//     equilibrium_bench [tolerance_mm ...]

#include "meshing/primitives.hpp"
#include "shaders/device.hpp"
#include "tled/equilibrium.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

using namespace tissuewarp;

namespace {

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
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

bool has_gpu() {
    const auto devices = shaders::list_devices();
    return std::any_of(devices.begin(), devices.end(), [](const auto& device) { return device.hardware; });
}

void relax(tled::Engine& engine, const tled::RestStiffness& stiffness, const tled::NodalConditions& conditions,
           const Eigen::Matrix3Xd& exact, const std::vector<double>& tolerances) {
    std::printf("  %s\n", engine.description().c_str());
    for (const double tolerance : tolerances) {
        const double start = now();
        const auto found = tled::equilibrium(engine, stiffness, conditions, {.tolerance_mm = tolerance});
        const double seconds = now() - start;
        const double error = std::sqrt((found.displacement - exact).colwise().squaredNorm().maxCoeff());
        std::printf(
            "    tolerance %-5g %5d force evaluations, %2d lifted residuals, %6.2f s; true error %.4f mm, "
            "estimated %.4f mm (effectivity %.2f), min J %.2f\n",
            tolerance, found.force_evaluations, found.lifted_residuals, seconds, error, found.estimated_error_mm,
            found.estimated_error_mm / error, found.min_jacobian);
    }
}

void solve_cube(int cells, double poisson, const std::vector<double>& tolerances) {
    tled::Model model;
    model.mesh = meshing::box_mesh({100, 100, 100}, {cells, cells, cells}, 0.2, 1);
    model.materials[1] = tled::neo_hookean_lnj(3.0, poisson);
    model.element = tled::Element::AveragedPressureT4;
    const tled::RestState rest = tled::rest_state(model);
    const auto conditions = tled::nodal_conditions(retraction(model.mesh), rest.node_count);
    double start = now();
    const tled::RestStiffness stiffness(rest, conditions);
    const double factor_seconds = now() - start;
    start = now();
    const double lowest = stiffness.lowest_eigenvalue();
    std::printf("cube n=%d nu=%g: %d T4, factor %.2f s, lowest eigenvalue %.2g in %.2f s\n", cells, poisson,
                rest.element_count(), factor_seconds, lowest, now() - start);

    const auto exact_engine = tled::make_cpu_engine(rest, tled::Scalar::Float64);
    const auto exact =
        tled::equilibrium(*exact_engine, stiffness, conditions, {.tolerance_mm = 1e-5, .max_steps = 40000});
    relax(*tled::make_cpu_engine(rest, tled::Scalar::Float32), stiffness, conditions, exact.displacement, tolerances);
    if (has_gpu()) relax(*tled::make_gpu_engine(rest), stiffness, conditions, exact.displacement, tolerances);
}

}  // namespace

int main(int argc, char** argv) {
    std::vector<double> tolerances;
    for (int i = 1; i < argc; ++i) tolerances.push_back(std::atof(argv[i]));
    if (tolerances.empty()) tolerances = {0.1, 0.01};
    solve_cube(16, 0.49, tolerances);
    solve_cube(24, 0.49, tolerances);
    solve_cube(12, 0.499, tolerances);
}
