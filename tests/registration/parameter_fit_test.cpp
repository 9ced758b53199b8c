/// Parameters that data tell are found again; those that they do not are left alone and named.
#include "registration/parameter_fit.hpp"

#include "core/errors.hpp"
#include "tests/support/label_shapes.hpp"
#include "tled/equilibrium.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <random>

namespace tissuewarp::registration {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Chosen = std::function<bool(const Vector3d&)>;

constexpr double noise_mm = 0.05;

UpdateOptions in_one_frame() {
    UpdateOptions options;
    options.device = Device::Cpu;
    options.align = false;
    return options;
}

FitOptions fitting(const std::vector<std::string>& names) {
    FitOptions options;
    for (const std::string& name : names) options.parameters.push_back(fit_parameter(name));
    return options;
}

/// An ellipsoid of 90 × 70 × 60 mm with a ball of 22 mm radius in it.
imaging::Volume labels() {
    shapes::Organ organ;
    organ.inclusion_radius = 16;
    return shapes::organ_labels(organ);
}

PrepareOptions coarse(double poissons_ratio, double ratio_of_ball = 1) {
    PrepareOptions options;
    options.meshing.edge_length = 7.5;
    options.materials[1] = tled::neo_hookean_lnj(3, poissons_ratio);
    options.materials[2] = tled::neo_hookean_lnj(3 * ratio_of_ball, poissons_ratio);
    return options;
}

/// What becomes of tissue whose nodes are held or moved at some places, under loads.
struct Experiment {
    Chosen held = [](const Vector3d& x) { return x[0] < -38; };
    Chosen moved = [](const Vector3d& x) { return x[0] > 38; };
    Vector3d motion{8, 0, -5};
    Matrix3Xd force;
};

Matrix3Xd truth(const PreparedModel& tissue, const Experiment& experiment) {
    tled::Conditions conditions;
    const Matrix3Xd& nodes = tissue.model.mesh.nodes;
    for (int n = 0; n < nodes.cols(); ++n) {
        if (experiment.held(nodes.col(n))) conditions.prescribed.push_back({n});
        if (experiment.moved(nodes.col(n)))
            conditions.prescribed.push_back({n, {true, true, true}, experiment.motion});
    }
    conditions.external_force = experiment.force;
    const auto nodal = tled::nodal_conditions(conditions, tissue.rest.node_count);
    const auto engine = tled::make_cpu_engine(tissue.rest, tled::Scalar::Float64);
    tled::EquilibriumOptions options;
    options.tolerance_mm = 1e-4;
    return tled::equilibrium(*engine, tled::RestStiffness(tissue.rest, nodal), nodal, options).displacement;
}

/// Nodes found again, with noise.
PointPairs pairs(const PreparedModel& tissue, const Matrix3Xd& displacement, const Chosen& seen) {
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0, noise_mm);
    std::vector<int> chosen;
    for (int n = 0; n < tissue.rest.node_count; ++n)
        if (seen(tissue.model.mesh.nodes.col(n))) chosen.push_back(n);
    PointPairs result{tissue.model.mesh.nodes(Eigen::all, chosen), {}, 0.2};
    result.fixed = result.moving + displacement(Eigen::all, chosen);
    for (double& value : result.fixed.reshaped()) value += noise(random);
    return result;
}

bool everywhere(const Vector3d&) { return true; }

void print(const ParameterFit& fit) {
    for (const FittedParameter& p : fit.parameters)
        std::printf("%s: given %g fitted %g +- %g %s, %s\n", p.name.c_str(), p.given, p.fitted, p.deviation,
                    p.unit.c_str(), p.reason.c_str());
    std::printf("misfit %g, %d blocks, %d equilibria, %d forces, %.2f s\n", fit.misfit_ratio, fit.blocks,
                fit.equilibria, fit.force_evaluations, fit.seconds);
}

TEST(ParameterFit, PoissonsRatioIsFound) {
    const auto soft = prepare(labels(), coarse(0.3));
    const Matrix3Xd u = truth(soft, {});
    PreparedModel prepared = prepare(labels(), coarse(0.45));
    const auto fitted = update_and_fit(prepared, {.points = pairs(soft, u, everywhere)}, in_one_frame(),
                                       fitting({"poissons-ratio"}));
    std::printf("%d nodes\n", prepared.rest.node_count);
    print(fitted.fit);
    const auto patch = [](const Vector3d& x) { return x[2] > 20; };
    print(update_and_fit(prepared, {.points = pairs(soft, u, patch)}, in_one_frame(), fitting({"poissons-ratio"})).fit);
}

TEST(ParameterFit, Stiffness) {
    const auto stiff = prepare(labels(), coarse(0.45, 4));
    const Matrix3Xd u = truth(stiff, {});
    const auto prepared = prepare(labels(), coarse(0.45));
    const auto go = [&](const Chosen& seen, const std::vector<std::string>& names) {
        const auto result = update(prepared, {.points = pairs(stiff, u, seen)}, in_one_frame());
        print(fit_parameters(prepared, result, in_one_frame(), fitting(names)));
    };
    go(everywhere, {"stiffness-ratio:2"});
    go([](const Vector3d& x) { return x[0] < -15; }, {"stiffness-ratio:2"});
    go(everywhere, {"stiffness-ratio:1", "stiffness-ratio:2"});
}

TEST(ParameterFit, Gravity) {
    const auto prepared = prepare(labels(), coarse(0.45));
    Experiment sag;
    sag.held = [](const Vector3d& x) { return x[2] < -25; };
    sag.moved = [](const Vector3d&) { return false; };
    const Vector3d gravity(0.4, -0.3, -0.6);
    sag.force = 9.80665e-3 * gravity * (prepared.rest.lumped_mass / prepared.model.density).transpose();
    const Matrix3Xd u = truth(prepared, sag);
    std::printf("max sag %g\n", std::sqrt(u.colwise().squaredNorm().maxCoeff()));
    const auto surface = [](const Vector3d& x) { return Vector3d(x[0] / 45, x[1] / 35, x[2] / 30).norm() > 0.93; };
    const auto result = update(prepared, {.points = pairs(prepared, u, surface)}, in_one_frame());
    print(fit_parameters(prepared, result, in_one_frame(), fitting({"gravity"})));
    print(fit_parameters(prepared, result, in_one_frame(), fitting({"gravity", "poissons-ratio", "pressure"})));
}

}  // namespace
}  // namespace tissuewarp::registration
