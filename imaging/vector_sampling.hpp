#pragma once
/// Vectors of a field between its voxels.

#include "core/errors.hpp"
#include "imaging/volume.hpp"

#include <algorithm>
#include <array>

namespace tissuewarp::imaging {

/// Trilinear interpolation of a volume of three float32 components. Holds a reference to the voxels, as copies of
/// cv::Mat do; safe to call from many threads.
class VectorSampler {
public:
    /// Throws InvalidInput unless the volume is float32 with three components.
    explicit VectorSampler(const Volume& field) : field_(field), to_index_(field.geometry.point_to_index()) {
        if (field.voxels.type() != CV_32FC3)
            throw InvalidInput("vector sampler: give a float32 volume of three components");
    }

    /// Continuous index (voxel) of an LPS point (mm).
    [[nodiscard]] Eigen::Vector3d index(const Eigen::Vector3d& point) const {
        return to_index_ * (point - field_.geometry.origin);
    }

    /// True when the point lies in the box of the voxels, half a voxel beyond the outermost centres included.
    [[nodiscard]] bool contains(const Eigen::Vector3d& point) const {
        const Eigen::Vector3d at = index(point);
        for (std::size_t axis = 0; axis < 3; ++axis)
            if (!(at[axis] >= -0.5 && at[axis] <= field_.geometry.size[axis] - 0.5)) return false;
        return true;
    }

    /// The vector at an LPS point (mm); beyond the outermost voxel centres that of the nearest point of the grid.
    [[nodiscard]] Eigen::Vector3d value(const Eigen::Vector3d& point) const {
        const Eigen::Vector3d at = index(point);
        std::array<int, 3> lower{}, upper{};
        Eigen::Vector3d fraction;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const int last = field_.geometry.size[axis] - 1;
            const double clamped = at[axis] > 0.0 ? std::min<double>(at[axis], last) : 0.0;  // NaN lands on 0
            lower[axis] = static_cast<int>(clamped);
            upper[axis] = std::min(lower[axis] + 1, last);
            fraction[axis] = clamped - lower[axis];
        }
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (int corner = 0; corner < 8; ++corner) {
            double weight = 1;
            std::array<int, 3> voxel{};
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const bool far = corner >> axis & 1;
                weight *= far ? fraction[axis] : 1 - fraction[axis];
                voxel[axis] = far ? upper[axis] : lower[axis];
            }
            const cv::Vec3f& v = field_.data<cv::Vec3f>()[field_.offset(voxel[0], voxel[1], voxel[2])];
            sum += weight * Eigen::Vector3d(v[0], v[1], v[2]);
        }
        return sum;
    }

private:
    Volume field_;
    Eigen::Matrix3d to_index_;
};

}  // namespace tissuewarp::imaging
