#include "tests/verification/effect_column.hpp"

#include "meshing/primitives.hpp"
#include "tled/load_path.hpp"

#include <cmath>

namespace tissuewarp::verification::effects {

using Eigen::Matrix3Xd;
using Eigen::Matrix3Xi;
using Eigen::Vector3d;
using tled::Conditions;
using tled::Model;
using tled::RestState;

namespace {

/// P of W = μ/2 (λ^(−2/3) (2 + λ²) − 3) + κ/2 (λ − 1)², kPa.
double column_stress(double stretch) {
    const auto law = tled::neo_hookean_iso(modulus, poisson);
    return 0.5 * law.shear_modulus *
               (-2.0 / 3 * std::pow(stretch, -5.0 / 3) * (2 + stretch * stretch) + 2 * std::cbrt(stretch)) +
           law.bulk_modulus * (stretch - 1);
}

}  // namespace

Model column(int cells) {
    Model model;
    model.mesh = meshing::box_mesh({side, side, length}, {1, 1, cells});
    model.materials = {{1, tled::neo_hookean_iso(modulus, poisson)}};
    model.element = tled::Element::T4;
    model.density = density;
    return model;
}

double column_stretch(double stress) {
    double low = 0.2, high = 3.0;
    for (int i = 0; i < 80; ++i) (column_stress(0.5 * (low + high)) < stress ? low : high) = 0.5 * (low + high);
    return 0.5 * (low + high);
}

double deformed_length(const std::function<double(double)>& stress, double from, double to) {
    constexpr int parts = 400;
    double sum = 0;
    for (int i = 0; i <= parts; ++i) {
        const double weight = i == 0 || i == parts ? 1 : i % 2 == 1 ? 4 : 2;
        sum += weight * column_stretch(stress(from + (to - from) * i / parts));
    }
    return sum * (to - from) / (3 * parts);
}

void guide(const Model& model, bool base_held, Conditions& conditions) {
    for (int a = 0; a < model.mesh.node_count(); ++a)
        conditions.prescribed.push_back({a, {true, true, base_held && model.mesh.nodes(2, a) < 1e-9}, {0, 0, 0}});
}

Matrix3Xd weight(const RestState& rest, const Vector3d& pull) {
    return pull * rest.lumped_mass.transpose();
}

double mean(const Model& model, const Matrix3Xd& u, int component, const std::function<bool(const Vector3d&)>& on) {
    double sum = 0;
    int count = 0;
    for (int a = 0; a < model.mesh.node_count(); ++a)
        if (on(model.mesh.nodes.col(a))) {
            sum += u(component, a);
            ++count;
        }
    return sum / count;
}

bool on_top(const Vector3d& X) {
    return X.z() > length - 1e-9;
}

Matrix3Xd settle(const Model& model, const Conditions& conditions, const MakeEngine& make, double tolerance_mm) {
    const RestState rest = tled::rest_state(model);
    const tled::NodalConditions nodal = tled::nodal_conditions(conditions, rest);
    const auto engine = make(rest);
    tled::LoadPathOptions options;
    options.equilibrium = {.tolerance_mm = tolerance_mm, .rest = &rest};
    return tled::equilibrium_along_load(*engine, tled::RestStiffness(rest, nodal), nodal, options).displacement;
}

double sag_of_column() {
    return deformed_length([](double X) { return -density * gravity * (length - X); }, 0, length) - length;
}

}  // namespace tissuewarp::verification::effects
