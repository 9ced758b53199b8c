#pragma once
/// The constitutive laws in plain float64, one deformation gradient at a time: what reference.cpp is built from and
/// what the kernels of the engines are tested against. Stresses and moduli in kPa.

#include "tled/material.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled {

/// The law of index `law` in Material with these moduli (kPa).
Material material_of_law(std::size_t law, double shear_modulus, double volumetric_modulus);

/// Ψ(F), kPa; +∞ where det F ≤ 0, so that line searches turn back.
double shear_energy(const Material& material, const Eigen::Matrix3d& F);

/// P_Ψ = ∂Ψ/∂F, first Piola–Kirchhoff stress of the shear part, kPa. Precondition: det F > 0.
Eigen::Matrix3d shear_stress(const Material& material, const Eigen::Matrix3d& F);

/// ∂P/∂F of an isotropic law. With G = F⁻ᵀ it acts on dF as
/// a dF + b [(G:dF) F + (F:dF) G] + c (G:dF) G + d G dFᵀ G.
struct Tangent {
    Eigen::Matrix3d F = Eigen::Matrix3d::Identity(), G = Eigen::Matrix3d::Identity();
    double a = 0, b = 0, c = 0, d = 0;  ///< kPa

    [[nodiscard]] Eigen::Matrix3d apply(const Eigen::Matrix3d& dF) const;
    /// Row 3j + i, column 3l + k: ∂P_ij/∂F_kl (column-major order of both).
    [[nodiscard]] Eigen::Matrix<double, 9, 9> matrix() const;
};

/// ∂P_Ψ/∂F. Precondition: det F > 0.
Tangent shear_tangent(const Material& material, const Eigen::Matrix3d& F);

/// Adds the tangent of the volumetric stress p cof F with dp = stiffness · dJ (both kPa) to a tangent at the same F.
void add_volumetric_tangent(Tangent& tangent, double pressure, double stiffness);

/// U(J) and its derivatives, without dimension. `energy` is +∞ where J ≤ 0, the derivatives need J > 0.
struct VolumetricFunction {
    double energy = 0, first = 0, second = 0;
};
VolumetricFunction volumetric_function(const Material& material, double J);

/// W(F) = Ψ(F) + M U(det F), kPa.
double strain_energy(const Material& material, const Eigen::Matrix3d& F);

/// P = ∂W/∂F, kPa. Precondition: det F > 0.
Eigen::Matrix3d first_piola_kirchhoff_stress(const Material& material, const Eigen::Matrix3d& F);

/// cof F = ∂(det F)/∂F = J F⁻ᵀ, by products: valid for singular F too.
Eigen::Matrix3d cofactor(const Eigen::Matrix3d& F);

/// d(cof F) for dF.
Eigen::Matrix3d cofactor_derivative(const Eigen::Matrix3d& F, const Eigen::Matrix3d& dF);

}  // namespace tissuewarp::tled
