#include "benchmarks/stretched_cube.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace tissuewarp::stretched_cube {

namespace {

/// The same rest state, of one material, under another law of the same moduli at rest.
void use_law(tled::RestState& rest, const tled::Material& material) {
    rest.materials = {material};
    const double modulus = tled::volumetric_modulus(material);
    if (rest.pressure.count() == 0) rest.volumetric_modulus.setConstant(modulus);
    rest.pressure.modulus.setConstant(modulus);
}

}  // namespace

Scene stretched(meshing::TetMesh mesh, double stretch) {
    Scene scene;
    scene.mesh = std::move(mesh);
    const Eigen::RowVectorXd z = scene.mesh.nodes.row(2);
    const double bottom = z.minCoeff(), height = z.maxCoeff() - bottom;
    const int count = scene.mesh.node_count();
    scene.start = Eigen::Matrix3Xd::Zero(3, count);
    tled::Conditions conditions;
    for (int node = 0; node < count; ++node) {
        const double part = (z[node] - bottom) / height;
        scene.start(2, node) = stretch * height * part;
        if (part < 0.01 || part > 0.99)
            conditions.prescribed.push_back({node, {true, true, true}, scene.start.col(node)});
    }
    scene.conditions = tled::nodal_conditions(conditions, count);
    return scene;
}

std::vector<Variant> variants(const Scene& scene, const std::string& element, const std::string& law) {
    const tled::NeoHookeanLnJ lnj{shear, lambda};
    const tled::NeoHookeanIso iso{shear, lambda + 2 * shear / 3};
    std::vector<Variant> result;
    for (const bool averaged : {false, true}) {
        if (!element.empty() && (element == "averaged") != averaged) continue;
        tled::Model model;
        model.mesh = scene.mesh;
        model.materials[1] = lnj;
        model.element = averaged ? tled::Element::AveragedPressureT4 : tled::Element::T4;
        tled::RestState rest = tled::rest_state(model);
        const std::string name = averaged ? "averaged " : "T4 ";
        if (law != "iso") result.push_back({name + "lnJ", rest});
        if (law == "lnj") continue;
        use_law(rest, iso);
        result.push_back({name + "iso", std::move(rest)});
    }
    return result;
}

std::vector<Variant> tissues(const Scene& scene, const std::string& element) {
    const double bulk = lambda + 2 * shear / 3;
    const tled::NeoHookeanIso iso{shear, bulk};
    const tled::TransverselyIsotropic fibres{shear, bulk, shear, Eigen::Vector3d(1, 2, 2) / 3};
    // Those of the brain (Miller and Chinzei, J. Biomech. 35, 2002, table 1), and one that moves with every step.
    const tled::PronySeries none, one{{{0.45, 0.5}}}, two{{{0.45, 0.5}, {0.365, 50.0}}}, fast{{{0.45, 0.001}}};
    const auto tissue = [&](const std::string& name, const tled::Material& material, const tled::PronySeries& series) {
        tled::Model model;
        model.mesh = scene.mesh;
        model.materials[1] = material;
        if (!series.terms.empty()) model.viscosity[1] = series;
        model.element = element == "averaged" ? tled::Element::AveragedPressureT4 : tled::Element::T4;
        return Variant{name, tled::rest_state(model)};
    };
    return {tissue("iso", iso, none),
            tissue("lnJ", tled::NeoHookeanLnJ{shear, lambda}, none),
            tissue("fibres", fibres, none),
            tissue("iso, 1 term", iso, one),
            tissue("iso, 2 terms", iso, two),
            tissue("lnJ, 1 term", tled::NeoHookeanLnJ{shear, lambda}, one),
            tissue("fibres, 1 term", fibres, one),
            tissue("fibres, 2 terms", fibres, two),
            tissue("iso, fast term", iso, fast),
            tissue("fibres, fast term", fibres, fast)};
}

std::vector<std::vector<double>> in_turn(const std::vector<std::function<double()>>& run, int turns) {
    std::vector<std::vector<double>> results(run.size());
    for (int turn = 0; turn < turns; ++turn)
        for (std::size_t i = 0; i < run.size(); ++i) results[i].push_back(run[i]());
    return results;
}

tled::StepCoefficients coefficients(const tled::RestState& rest) {
    double sum = 0;
    for (int e = 0; e < rest.element_count(); ++e) {
        const auto gradient = rest.gradient.col(e).reshaped(3, 3);
        sum = std::max(sum, gradient.squaredNorm() + gradient.rowwise().sum().squaredNorm());
    }
    const double time_step = 0.9 * 2 / std::sqrt(4 * (lambda + 2 * shear) / density * sum);  // s
    return {(1 - 0.01) / (1 + 0.01), time_step * time_step / (1 + 0.01), time_step};
}

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

}  // namespace tissuewarp::stretched_cube
