#include "tled/constitutive.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <limits>
#include <string>

#include "core/errors.hpp"

namespace tissuewarp::tled {

using Eigen::Matrix3d;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

double contract(const Matrix3d& A, const Matrix3d& B) {
    return A.cwiseProduct(B).sum();
}

// The isochoric law, Bonet & Wood, Nonlinear Continuum Mechanics for Finite Element Analysis (2008), section 6.5:
// Ψ = μ/2 (J^(−2/3) tr C − 3), so P = μ J^(−2/3) (F − tr C/3 F⁻ᵀ), and with d(F⁻ᵀ) = −F⁻ᵀ dFᵀ F⁻ᵀ, dJ = J F⁻ᵀ:dF the
// tangent below. U = (J − 1)²/2.
double shear_energy_of(const NeoHookeanIso& law, const Matrix3d& F, double J) {
    return 0.5 * law.shear_modulus * (std::pow(J, -2.0 / 3.0) * F.squaredNorm() - 3.0);
}

Matrix3d shear_stress_of(const NeoHookeanIso& law, const Matrix3d& F, double J) {
    const double scale = law.shear_modulus * std::pow(J, -2.0 / 3.0);
    return scale * (F - F.squaredNorm() / 3.0 * F.inverse().transpose());
}

void set_shear_tangent(const NeoHookeanIso& law, double J, Tangent& t) {
    const double scale = law.shear_modulus * std::pow(J, -2.0 / 3.0), trace_C = t.F.squaredNorm();
    t.a = scale;
    t.b = -2.0 / 3.0 * scale;
    t.c = 2.0 / 9.0 * trace_C * scale;
    t.d = trace_C / 3.0 * scale;
}

VolumetricFunction volumetric_of(const NeoHookeanIso& /*law*/, double J) {
    return {0.5 * (J - 1.0) * (J - 1.0), J - 1.0, 1.0};
}

// The compressible neo-Hookean law, Bonet & Wood, equation 6.27:
// Ψ = μ/2 (tr C − 3) − μ ln J, so P = μ (F − F⁻ᵀ) and dP = μ (dF + F⁻ᵀ dFᵀ F⁻ᵀ). U = (ln J)²/2.
double shear_energy_of(const NeoHookeanLnJ& law, const Matrix3d& F, double J) {
    return law.shear_modulus * (0.5 * (F.squaredNorm() - 3.0) - std::log(J));
}

Matrix3d shear_stress_of(const NeoHookeanLnJ& law, const Matrix3d& F, double /*J*/) {
    return law.shear_modulus * (F - F.inverse().transpose());
}

void set_shear_tangent(const NeoHookeanLnJ& law, double /*J*/, Tangent& t) {
    t.a = law.shear_modulus;
    t.d = law.shear_modulus;
}

VolumetricFunction volumetric_of(const NeoHookeanLnJ& /*law*/, double J) {
    const double log_J = std::log(J);
    return {0.5 * log_J * log_J, log_J / J, (1.0 - log_J) / (J * J)};
}

}  // namespace

Material material_of_law(std::size_t law, double shear_modulus, double volumetric_modulus) {
    static_assert(std::variant_size_v<Material> == 2, "a new law needs its case here");
    switch (law) {
        case 0:
            return NeoHookeanIso{shear_modulus, volumetric_modulus};
        case 1:
            return NeoHookeanLnJ{shear_modulus, volumetric_modulus};
        default:
            throw InvalidInput("constitutive law " + std::to_string(law) + " does not exist: use 0 or 1");
    }
}

double shear_energy(const Material& material, const Matrix3d& F) {
    const double J = F.determinant();
    if (!(J > 0.0)) return infinity;
    return std::visit([&](const auto& law) { return shear_energy_of(law, F, J); }, material);
}

Matrix3d shear_stress(const Material& material, const Matrix3d& F) {
    return std::visit([&](const auto& law) { return shear_stress_of(law, F, F.determinant()); }, material);
}

Tangent shear_tangent(const Material& material, const Matrix3d& F) {
    Tangent tangent;
    tangent.F = F;
    tangent.G = F.inverse().transpose();
    std::visit([&](const auto& law) { set_shear_tangent(law, F.determinant(), tangent); }, material);
    return tangent;
}

void add_volumetric_tangent(Tangent& tangent, double pressure, double stiffness) {
    // d(p J G) = stiffness J² (G:dF) G + p J [(G:dF) G − G dFᵀ G].
    const double J = tangent.F.determinant();
    tangent.c += stiffness * J * J + pressure * J;
    tangent.d -= pressure * J;
}

Matrix3d Tangent::apply(const Matrix3d& dF) const {
    const double G_dF = contract(G, dF), F_dF = contract(F, dF);
    return a * dF + b * (G_dF * F + F_dF * G) + c * G_dF * G + d * G * dF.transpose() * G;
}

Eigen::Matrix<double, 9, 9> Tangent::matrix() const {
    Eigen::Matrix<double, 9, 9> result;
    for (int column = 0; column < 9; ++column) {
        Matrix3d unit = Matrix3d::Zero();
        unit(column % 3, column / 3) = 1.0;
        result.col(column) = apply(unit).reshaped();
    }
    return result;
}

VolumetricFunction volumetric_function(const Material& material, double J) {
    if (!(J > 0.0)) return {infinity, 0.0, 0.0};
    return std::visit([&](const auto& law) { return volumetric_of(law, J); }, material);
}

double strain_energy(const Material& material, const Matrix3d& F) {
    const double J = F.determinant();
    if (!(J > 0.0)) return infinity;  // not 0 · ∞ where the modulus is zero
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
