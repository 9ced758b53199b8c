// Neo-Hookean laws whose shear part is not isochoric.

#include <Eigen/LU>

#include <cmath>

#include "tled/material/constitutive.hpp"
#include "tled/material/laws.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;

// Bonet & Wood, Nonlinear Continuum Mechanics for Finite Element Analysis (2008), equation 6.27:
// Ψ = μ/2 (tr C − 3) − μ ln J, so P = μ (F − G) with G = F⁻ᵀ and dG = −G dFᵀ G.
double shear_energy_of(const NeoHookeanLnJ& law, const Matrix3d& F) {
    return law.shear_modulus * (0.5 * (F.squaredNorm() - 3.0) - std::log(F.determinant()));
}

Matrix3d shear_stress_of(const NeoHookeanLnJ& law, const Matrix3d& F) {
    return law.shear_modulus * (F - F.inverse().transpose());
}

Matrix3d shear_derivative_of(const NeoHookeanLnJ& law, const Matrix3d& F, const Matrix3d& dF) {
    const Matrix3d G = F.inverse().transpose();
    return law.shear_modulus * (dF + G * dF.transpose() * G);
}

// Smith, de Goes, Kim (2018). λ'/2 (J − α)² = λ'/2 (J − 1)² − ¾ μ' (J − 1) + constant, so the volumetric part is
// λ' (J − 1)²/2 and Ψ = μ'/2 (tr C − 3) − μ'/2 ln((tr C + 1)/4) − ¾ μ' (J − 1).
double shear_energy_of(const NeoHookeanStable& law, const Matrix3d& F) {
    const double mu = 4.0 / 3.0 * law.shear_modulus, trace = F.squaredNorm();
    return 0.5 * mu * (trace - 3.0 - std::log((trace + 1.0) / 4.0)) - 0.75 * mu * (F.determinant() - 1.0);
}

Matrix3d shear_stress_of(const NeoHookeanStable& law, const Matrix3d& F) {
    const double mu = 4.0 / 3.0 * law.shear_modulus;
    return mu * (1.0 - 1.0 / (F.squaredNorm() + 1.0)) * F - 0.75 * mu * cofactor(F);
}

Matrix3d shear_derivative_of(const NeoHookeanStable& law, const Matrix3d& F, const Matrix3d& dF) {
    const double mu = 4.0 / 3.0 * law.shear_modulus, denominator = F.squaredNorm() + 1.0;
    return mu * ((1.0 - 1.0 / denominator) * dF + 2.0 * contract(F, dF) / (denominator * denominator) * F) -
           0.75 * mu * cofactor_derivative(F, dF);
}

}  // namespace tissuewarp::tled::detail
