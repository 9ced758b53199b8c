#pragma once
/// Quadratic tetrahedra at a displacement that is linear in every element. There F and the tangent moduli are constant
/// in an element, so that all integrals are known in closed form and nothing larger than 9 × 9 is held for an element.

#include "tled/error/hierarchical_space.hpp"
#include "tled/rest_state.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::tled::detail {

/// In local coordinates ξ of the unit tetrahedron: with ∂u/∂ξ = D (columns one after the other) and G = ∂ξ/∂X, ∇u = D
/// G.
struct HierarchicalElement {
    Eigen::Matrix<double, 9, 9> tangent;      ///< V (G ⊗ 1) ∂P/∂F (G ⊗ 1)ᵀ at fixed averages of J, mN/mm
    Eigen::Matrix<double, 9, 1> shear;        ///< V P_Ψ Gᵀ, mN
    Eigen::Matrix<double, 9, 1> volume_rate;  ///< V cof F Gᵀ, mm²: its product with D is the rate of the volume
    Eigen::Vector4d pressure;                 ///< M U' at the corners, kPa: of their averaged J, or of the element's J
    bool averaged = false;                    ///< J is averaged at the corners
};

struct HierarchicalTissue {
    const HierarchicalSpace& space;
    const RestState& rest;
    std::vector<HierarchicalElement> elements;  ///< in the internal order
    Eigen::VectorXd nodal_modulus;  ///< M_a U''(J_a) / V_a of the pressure nodes, kPa/mm³, with M_a U'' between 0 and
                                    ///< 20 μ; 0 where J is not averaged
};

/// Tangent moduli as they are, or without their negative part (Teran, Sifakis, Irving, Fedkiw, SCA 2005, 181): pressed
/// tissue may be stable although ∂P/∂F of its elements is not positive, and unstable in elements finer than those that
/// it was brought to equilibrium in.
enum class Moduli { Exact, PositivePart };

/// At `displacement` (3 × N mm of the corners). `rest` has averaged pressure; where `averaged` (of every material of
/// `rest`) is false the volumetric energy is that of J in every point instead. Keeps references. Precondition: det F >
/// 0 or a law that admits inversion.
HierarchicalTissue hierarchical_tissue(const HierarchicalSpace& space, const RestState& rest,
                                       const std::vector<bool>& averaged, const Eigen::Matrix3Xd& displacement,
                                       Moduli moduli);

/// Minus the elastic forces on bubbles; on corners, what linear elements with `pressure` (kPa, of every element) bear
/// more than quadratic ones. mN, 3 × size().
Eigen::Matrix3Xd residual(const HierarchicalTissue& tissue, const Eigen::VectorXd& pressure);

/// The 3 × 3 blocks of the bubbles on the diagonal of the tangent stiffness, mN/mm.
std::vector<Eigen::Matrix3d> bubble_blocks(const HierarchicalTissue& tissue);

/// S ∂L_corner/∂ξ for the hat function of a corner, S with three columns.
template <class Matrix>
Eigen::Vector3d times_hat_gradient(const Matrix& S, int corner) {
    if (corner > 0) return S.col(corner - 1);
    return -S.rowwise().sum();
}

}  // namespace tissuewarp::tled::detail
