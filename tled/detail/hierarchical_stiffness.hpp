#pragma once
/// Forces and tangent stiffness of quadratic tetrahedra at a displacement that is linear in every element. There F and
/// the tangent moduli are constant in an element, so that all integrals are known in closed form and nothing larger
/// than 9 × 9 is stored for an element.

#include "tled/detail/hierarchical_space.hpp"
#include "tled/rest_state.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::tled::detail {

/// Derivatives by the local coordinates of the unit tetrahedron take the place of those by X: with ∂u/∂ξ = D and
/// G = ∂ξ/∂X, ∇u = D G. Column-major 9-vectors of D are multiplied by V (G ⊗ 1) ∂P/∂F (G ⊗ 1)ᵀ.
struct HierarchicalElement {
    Eigen::Matrix<double, 9, 9> tangent;      ///< mN/mm, of the energy at fixed averages of J
    Eigen::Matrix<double, 9, 1> volume_rate;  ///< V cof F Gᵀ: its product with D is the rate of the volume, mm²
    bool averaged = false;                    ///< J is averaged at the corners
};

/// The tissue at a displacement (3 × N mm of the corners).
class HierarchicalStiffness {
public:
    /// `rest` has averaged pressure; where `averaged` (one entry per material of `rest`) is false, the volumetric
    /// energy is that of the elements' own J. Keeps references. Precondition: det F > 0 or a law that admits inversion.
    HierarchicalStiffness(const HierarchicalSpace& space, const RestState& rest, const std::vector<bool>& averaged,
                          const Eigen::Matrix3Xd& displacement);

    /// Minus the elastic forces of the space at the displacement, at the corners less those of the linear elements, of
    /// which `pressure` (kPa) is that in every element, mN, 3 × size().
    [[nodiscard]] Eigen::Matrix3Xd residual(const Eigen::VectorXd& pressure) const;

    /// K x, 3 × size(), the same bits for any number of threads.
    [[nodiscard]] Eigen::Matrix3Xd multiply(const Eigen::Matrix3Xd& x) const;

    /// The 3 × 3 blocks of the bubbles on the diagonal of K.
    [[nodiscard]] std::vector<Eigen::Matrix3d> bubble_blocks() const;

private:
    using Vector9 = Eigen::Matrix<double, 9, 1>;
    using Corners9 = Eigen::Matrix<double, 9, 4>;  // of a function linear in an element, at its corners
    using Forces = Eigen::Matrix<double, 3, 10>;

    void linearise(const Eigen::Matrix3Xd& displacement);
    [[nodiscard]] Corners9 derivatives(const Eigen::Matrix3Xd& x, int element) const;
    [[nodiscard]] Eigen::Matrix3Xd gathered(const std::vector<Forces>& forces) const;
    /// M_a U'' times the rate of the averaged J along x, kPa.
    [[nodiscard]] Eigen::VectorXd nodal_rates(const Eigen::Matrix3Xd& x) const;
    void add_averages(std::vector<Eigen::Matrix3d>& blocks) const;

    const HierarchicalSpace& space_;
    const RestState& rest_;
    std::vector<bool> averaged_;
    std::vector<HierarchicalElement> elements_;
    Eigen::Matrix4Xd pressure_;      // kPa at the corners of every element
    std::vector<Vector9> shear_;     // V P_Ψ Gᵀ
    Eigen::VectorXd nodal_modulus_;  // M_a U''(J_a) / V_a of the pressure nodes, kPa/mm³, not negative
};

}  // namespace tissuewarp::tled::detail
