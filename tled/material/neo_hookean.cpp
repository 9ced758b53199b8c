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

// Smith, de Goes, Kim (2018). λ'/2 (J − α)² = λ'/2 (J − 1)² − ¾ μ' (J − 1) + constant. All of λ' in the volumetric part
// would leave Ψ = −0.56 μ' e² for a change e of all lengths, and where that part is averaged, volumes that alternate
// from element to element would have no resistance. So a μ'/4 of λ' stays here, Ψ(e) = 0.56 μ' e², and the
// volumetric part is (λ' − μ'/4)(J − 1)²/2.
double shear_energy_of(const NeoHookeanStable& law, const Matrix3d& F) {
    const double mu = 4.0 / 3.0 * law.shear_modulus, trace = F.squaredNorm(), change = F.determinant() - 1.0;
    return 0.5 * mu * (trace - 3.0 - std::log((trace + 1.0) / 4.0)) + mu * change * (0.125 * change - 0.75);
}

Matrix3d shear_stress_of(const NeoHookeanStable& law, const Matrix3d& F) {
    const double mu = 4.0 / 3.0 * law.shear_modulus;
    return mu * (1.0 - 1.0 / (F.squaredNorm() + 1.0)) * F + mu * (0.25 * (F.determinant() - 1.0) - 0.75) * cofactor(F);
}

Matrix3d shear_derivative_of(const NeoHookeanStable& law, const Matrix3d& F, const Matrix3d& dF) {
    const double mu = 4.0 / 3.0 * law.shear_modulus, denominator = F.squaredNorm() + 1.0;
    return mu * ((1.0 - 1.0 / denominator) * dF + 2.0 * contract(F, dF) / (denominator * denominator) * F) +
           mu * (0.25 * (F.determinant() - 1.0) - 0.75) * cofactor_derivative(F, dF) +
           0.25 * mu * contract(cofactor(F), dF) * cofactor(F);
}

}  // namespace tissuewarp::tled::detail
