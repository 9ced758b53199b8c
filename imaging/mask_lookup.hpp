#pragma once
/// Whether points lie in the voxels of a mask, for inner loops.

#include "imaging/volume.hpp"

#include <cmath>
#include <cstdint>

namespace tissuewarp::imaging {

/// Holds a reference to the voxels, as copies of cv::Mat do; safe to call from many threads.
class MaskLookup {
public:
    /// uint8 with one component, or empty: no point lies in an empty mask.
    explicit MaskLookup(const Volume& mask) : mask_(mask) {
        if (!mask.empty()) to_index_ = mask.geometry.point_to_index();
    }

    [[nodiscard]] bool empty() const { return mask_.empty(); }

    /// Whether the voxel that holds an LPS point (mm) is != 0; beyond the voxels' box none is.
    [[nodiscard]] bool operator()(const Eigen::Vector3d& point) const { return value(point) != 0; }
    /// Its value; 0 beyond the voxels' box.
    [[nodiscard]] std::uint8_t value(const Eigen::Vector3d& point) const {
        if (mask_.empty()) return 0;
        const Eigen::Array3d voxel = (to_index_ * (point - mask_.geometry.origin)).array().round();
        const auto& size = mask_.geometry.size;
        if (!((voxel >= 0).all() && voxel[0] < size[0] && voxel[1] < size[1] && voxel[2] < size[2])) return 0;
        const Eigen::Array3i at = voxel.cast<int>();
        return mask_.data<std::uint8_t>()[mask_.offset(at[0], at[1], at[2])];
    }

private:
    Volume mask_;
    Eigen::Matrix3d to_index_ = Eigen::Matrix3d::Identity();
};

}  // namespace tissuewarp::imaging
