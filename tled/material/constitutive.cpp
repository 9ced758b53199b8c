#include "tled/material/constitutive.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <limits>

#include "tled/material/laws.hpp"

namespace tissuewarp::tled {

using Eigen::Matrix3d;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

bool admissible(const Material& material, double J) {
    return J > 0.0 || admits_inversion(material);
}

/// A direction of unit length in F: component `index` of the column-major order.
Matrix3d unit_direction(int index) {
    Matrix3d unit = Matrix3d::Zero();
    unit.data()[index] = 1.0;
    return unit;
}

template <class Law>
VolumetricFunction volumetric_of(const Law& /*law*/, double J) {
    return {0.5 * (J - 1.0) * (J - 1.0), J - 1.0, 1.0};
}

VolumetricFunction volumetric_of(const NeoHookeanLnJ& /*law*/, double J) {
    const double log_J = std::log(J);
    return {0.5 * log_J * log_J, log_J / J, (1.0 - log_J) / (J * J)};
}

VolumetricFunction volumetric_of(const ArrudaBoyce& /*law*/, double J) {
    return {0.5 * (0.5 * (J * J - 1.0) - std::log(J)), 0.5 * (J - 1.0 / J), 0.5 * (1.0 + 1.0 / (J * J))};
}

}  // namespace

double shear_energy(const Material& material, const Matrix3d& F) {
    if (!admissible(material, F.determinant())) return infinity;
    return std::visit([&](const auto& law) { return detail::shear_energy_of(law, F); }, material);
}

Matrix3d shear_stress(const Material& material, const Matrix3d& F) {
    return std::visit([&](const auto& law) { return detail::shear_stress_of(law, F); }, material);
}

Tangent shear_tangent(const Material& material, const Matrix3d& F) {
    Tangent tangent{.F = F};
    std::visit(
        [&](const auto& law) {
            for (int k = 0; k < 9; ++k)
                tangent.derivative.col(k) = detail::shear_derivative_of(law, F, unit_direction(k)).reshaped();
        },
        material);
    return tangent;
}

void add_volumetric_tangent(Tangent& tangent, double pressure, double stiffness) {
    const Eigen::Matrix<double, 9, 1> cof = cofactor(tangent.F).reshaped();
    tangent.derivative += stiffness * cof * cof.transpose();
    for (int k = 0; k < 9; ++k)
        tangent.derivative.col(k) += pressure * cofactor_derivative(tangent.F, unit_direction(k)).reshaped();
}

Matrix3d Tangent::apply(const Matrix3d& dF) const {
    return (derivative * dF.reshaped()).reshaped(3, 3);
}

VolumetricFunction volumetric_function(const Material& material, double J) {
    if (!admissible(material, J)) return {infinity, 0.0, 0.0};
    return std::visit([&](const auto& law) { return volumetric_of(law, J); }, material);
}

double strain_energy(const Material& material, const Matrix3d& F) {
    const double J = F.determinant();
    if (!admissible(material, J)) return infinity;  // not 0 · ∞ where the modulus is zero
    return shear_energy(material, F) + volumetric_modulus(material) * volumetric_function(material, J).energy;
}

Matrix3d first_piola_kirchhoff_stress(const Material& material, const Matrix3d& F) {
    const double pressure = volumetric_modulus(material) * volumetric_function(material, F.determinant()).first;
    return shear_stress(material, F) + pressure * cofactor(F);
}

Matrix3d cofactor(const Matrix3d& F) {
    Matrix3d result;
    result << F.col(1).cross(F.col(2)), F.col(2).cross(F.col(0)), F.col(0).cross(F.col(1));
    return result;
}

Matrix3d cofactor_derivative(const Matrix3d& F, const Matrix3d& dF) {
    Matrix3d result;
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        result.col(i) = dF.col(j).cross(F.col(k)) + F.col(j).cross(dF.col(k));
    }
    return result;
}

}  // namespace tissuewarp::tled
