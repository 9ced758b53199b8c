#pragma once
/// Where a second image on the same grid shows what the first does, asked of every voxel at once.

#include "registration/matching/descriptors/matching_image.hpp"

#include <vector>

namespace tissuewarp::registration::detail {

/// What the voxels of a cell and those around it say together.
struct DenseForce {
    Eigen::Vector3d place = Eigen::Vector3d::Zero();        ///< mean of the cell's voxels that count, LPS mm
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();        ///< to where the second image shows the same, LPS mm
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< inverse covariance of the shift, 1/mm², LPS
};

/// Forces in cells of a grid, in the order of the cells.
struct DenseForces {
    std::vector<DenseForce> forces;
    imaging::Geometry cells;
    std::vector<std::uint8_t> said;  ///< 1 for the cells that have a force
    double agreement = 0;  ///< Σ ∇D₁·∇D₂ over Σ ½ (|∇D₁|² + |∇D₂|²): 1 for the same image, 0 by chance

    /// Whether the cell of a point (LPS mm) has a force.
    [[nodiscard]] bool say_something_at(const Eigen::Vector3d& point) const;
};

/// One Gauss–Newton step of D₂(x + δ) = D₁(x) for the descriptors D of both images (of self-similarity, on one grid), δ
/// the same in the window of a cell: δ = A⁻¹ b with A = Σ (∇D₁ ∇D₂ᵀ + ∇D₂ ∇D₁ᵀ)/2, in which the noise of one image
/// does not meet itself, and b = Σ (∇D₁ + ∇D₂)/2 (D₁ − D₂), of second order in δ (Malis, ICRA 2004); a difference D₁ −
/// D₂ = c D₁ + d, as noise and blur make it, is solved for with δ and is no motion. Counted are voxels that `counts`
/// names (one byte each) and that both images show with their six neighbours; cells without any and directions without
/// information have no force. Shifts are bounded to a voxel and a half. Formulas: docs/method.md, section 11. Threads
/// do not change the result.
DenseForces dense_forces(const MatchingImage& first, const MatchingImage& second,
                         const std::vector<std::uint8_t>& counts);

}  // namespace tissuewarp::registration::detail
