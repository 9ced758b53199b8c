#pragma once
/// The constitutive laws in plain float64, one deformation gradient at a time: what internal_force.cpp is built from
/// and what the kernels of the engines are tested against. Stresses and moduli in kPa.

#include "tled/material.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled {

/// Ψ(F), kPa; +∞ where det F ≤ 0 and the law does not admit it, so that line searches turn back.
double shear_energy(const Material& material, const Eigen::Matrix3d& F);

/// P_Ψ = ∂Ψ/∂F, first Piola–Kirchhoff stress of the shear part, kPa. Precondition: det F > 0, or the law
/// admits inversion.
Eigen::Matrix3d shear_stress(const Material& material, const Eigen::Matrix3d& F);

/// ∂P/∂F at F.
struct Tangent {
    Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
    /// Row 3j + i, column 3l + k: ∂P_ij/∂F_kl (column-major order of both), kPa. Symmetric.
    Eigen::Matrix<double, 9, 9> derivative = Eigen::Matrix<double, 9, 9>::Zero();

    [[nodiscard]] Eigen::Matrix3d apply(const Eigen::Matrix3d& dF) const;
    [[nodiscard]] const Eigen::Matrix<double, 9, 9>& matrix() const { return derivative; }
};

/// ∂P_Ψ/∂F. Precondition as for shear_stress.
Tangent shear_tangent(const Material& material, const Eigen::Matrix3d& F);

/// Adds the tangent of the volumetric stress p cof F with dp = stiffness · dJ (both kPa) to a tangent at the same F.
void add_volumetric_tangent(Tangent& tangent, double pressure, double stiffness);

/// U(J) and its derivatives, without dimension. `energy` is +∞ where J ≤ 0 and the law does not admit
/// it; the derivatives are zero there.
struct VolumetricFunction {
    double energy = 0, first = 0, second = 0;
};
VolumetricFunction volumetric_function(const Material& material, double J);

/// W(F) = Ψ(F) + M U(det F), kPa.
double strain_energy(const Material& material, const Eigen::Matrix3d& F);

/// P = ∂W/∂F, kPa. Precondition as for shear_stress.
Eigen::Matrix3d first_piola_kirchhoff_stress(const Material& material, const Eigen::Matrix3d& F);

/// cof F = ∂(det F)/∂F = J F⁻ᵀ, by products: valid for singular F too.
Eigen::Matrix3d cofactor(const Eigen::Matrix3d& F);

/// d(cof F) for dF.
Eigen::Matrix3d cofactor_derivative(const Eigen::Matrix3d& F, const Eigen::Matrix3d& dF);

}  // namespace tissuewarp::tled
