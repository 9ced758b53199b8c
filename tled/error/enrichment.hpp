#pragma once
/// One Newton step with bubbles on all edges: K x = r by conjugate gradients.

#include "tled/error/bubble_conditions.hpp"
#include "tled/error/discretisation_error.hpp"
#include "tled/error/hierarchical_product.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace tissuewarp::tled::detail {

/// Tangent stiffness of corners and bubbles with springs and constraints, and a cycle of two levels as preconditioner:
/// Chebyshev steps on the bubbles (Adams, Brezina, Hu, Tuminaro, J. Comput. Phys. 188 (2003) 593), about K₀⁻¹ on the
/// corners, the same steps again (hierarchical bases as in Bank, Acta Numerica 5 (1996) 1, section 5).
class Enrichment {
public:
    /// Keeps references. Precondition: the constraints of `corners` and `conditions` are the same.
    Enrichment(const HierarchicalTissue& tissue, const BubbleConditions& bubbles, const NodalConditions& conditions,
               const RestStiffness& corners);

    struct Solution {
        Eigen::Matrix3Xd x;  ///< 3 × size(), mm
        int iterations = 0;
        std::string failure;  ///< empty where x is the solution
    };
    /// Of K x = residual (mN) where nothing is prescribed; x is zero elsewhere.
    [[nodiscard]] Solution solve(Eigen::Matrix3Xd residual, const DiscretisationOptions& options) const;

private:
    [[nodiscard]] Eigen::Matrix3Xd multiply(const Eigen::Matrix3Xd& x) const;
    /// Of a residual; takes the forces of the result off it.
    [[nodiscard]] Eigen::Matrix3Xd precondition(Eigen::Matrix3Xd& residual) const;
    /// Adds to x what the bubbles' steps make of the residual, and takes their forces off it.
    void smooth(Eigen::Matrix3Xd& x, Eigen::Matrix3Xd& residual) const;
    [[nodiscard]] Eigen::Matrix3Xd divide_by_blocks(const Eigen::Matrix3Xd& residual) const;
    void constrain(Eigen::Matrix3Xd& x) const;

    const HierarchicalSpace& space_;
    const BubbleConditions& bubbles_;
    const NodalConditions& conditions_;
    const RestStiffness& corners_;
    HierarchicalProduct elastic_;
    std::vector<Eigen::Matrix3d> inverse_block_;  // of the bubbles
    double largest_ = 0;                          // eigenvalue of the bubbles' stiffness over its blocks
};

}  // namespace tissuewarp::tled::detail
