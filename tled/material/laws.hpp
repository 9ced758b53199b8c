#pragma once
/// The shear part Ψ of every law in float64: energy (kPa), P = ∂Ψ/∂F, and the derivative of P in a direction dF. A new
/// law adds its three overloads in a file of its family. Precondition: J = det F > 0, or the law admits inversion.

#include "tled/material.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled::detail {

/// A : B.
inline double contract(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B) {
    return A.cwiseProduct(B).sum();
}

// neo_hookean.cpp
double shear_energy_of(const NeoHookeanLnJ& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_stress_of(const NeoHookeanLnJ& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_derivative_of(const NeoHookeanLnJ& law, const Eigen::Matrix3d& F, const Eigen::Matrix3d& dF);
double shear_energy_of(const NeoHookeanStable& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_stress_of(const NeoHookeanStable& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_derivative_of(const NeoHookeanStable& law, const Eigen::Matrix3d& F, const Eigen::Matrix3d& dF);

// isochoric_invariants.cpp
double shear_energy_of(const NeoHookeanIso& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_stress_of(const NeoHookeanIso& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_derivative_of(const NeoHookeanIso& law, const Eigen::Matrix3d& F, const Eigen::Matrix3d& dF);
double shear_energy_of(const Polynomial& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_stress_of(const Polynomial& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_derivative_of(const Polynomial& law, const Eigen::Matrix3d& F, const Eigen::Matrix3d& dF);
double shear_energy_of(const ArrudaBoyce& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_stress_of(const ArrudaBoyce& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_derivative_of(const ArrudaBoyce& law, const Eigen::Matrix3d& F, const Eigen::Matrix3d& dF);
double shear_energy_of(const TransverselyIsotropic& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_stress_of(const TransverselyIsotropic& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_derivative_of(const TransverselyIsotropic& law, const Eigen::Matrix3d& F,
                                    const Eigen::Matrix3d& dF);

// ogden.cpp
double shear_energy_of(const Ogden& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_stress_of(const Ogden& law, const Eigen::Matrix3d& F);
Eigen::Matrix3d shear_derivative_of(const Ogden& law, const Eigen::Matrix3d& F, const Eigen::Matrix3d& dF);

/// Factors i C_i/λ_m^(2i−2) of ∂Ψ/∂Ī₁ = μ Σ (…) Ī₁^(i−1) in the eight-chain model.
std::array<double, 5> arruda_boyce_factors(double locking_stretch);

}  // namespace tissuewarp::tled::detail
