#pragma once
/// det(∂y/∂X) of a forward field at a voxel.

#include "imaging/volume.hpp"

#include <array>

namespace tissuewarp::registration::detail {

/// By central differences, one-sided at the border of the grid; an axis of one voxel has none. Refers to the field.
class VoxelJacobian {
public:
    /// Displacements in mm, three channels float32.
    explicit VoxelJacobian(const imaging::Volume& displacement)
        : size_(displacement.geometry.size),
          stride_{1, size_[0], std::int64_t{size_[0]} * size_[1]},
          to_index_(displacement.geometry.point_to_index()),
          field_(displacement.data<cv::Vec3f>()) {}

    [[nodiscard]] float determinant(const std::array<int, 3>& index) const {
        const std::int64_t voxel = index[0] + index[1] * stride_[1] + index[2] * stride_[2];
        Eigen::Matrix3d gradient;  // ∂d/∂index
        for (int axis = 0; axis < 3; ++axis) {
            const int back = index[axis] > 0, ahead = index[axis] + 1 < size_[axis];
            const cv::Vec3f& from = field_[voxel - back * stride_[axis]];
            const cv::Vec3f& to = field_[voxel + ahead * stride_[axis]];
            const double scale = 1.0 / std::max(back + ahead, 1);
            for (int c = 0; c < 3; ++c) gradient(c, axis) = scale * (double{to[c]} - from[c]);
        }
        const Eigen::Matrix3d F = Eigen::Matrix3d::Identity() + gradient * to_index_;
        return static_cast<float>(F.determinant());
    }

private:
    std::array<int, 3> size_;
    std::array<std::int64_t, 3> stride_;
    Eigen::Matrix3d to_index_;
    const cv::Vec3f* field_;
};

}  // namespace tissuewarp::registration::detail
