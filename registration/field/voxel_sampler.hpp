#pragma once
/// Voxels read at continuous indices, as warps do.

#include "imaging/volume.hpp"

#include <opencv2/core/saturate.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace tissuewarp::registration::detail {

/// Half a voxel beyond the outermost centres still belongs to the image, as in imaging::resample.
inline bool holds(const imaging::Geometry& grid, const Eigen::Vector3d& index) {
    for (int axis = 0; axis < 3; ++axis)
        if (!(index[axis] >= -0.5 - 1e-6 && index[axis] <= grid.size[axis] - 0.5 + 1e-6)) return false;
    return true;
}

/// The moving voxel grid, read at continuous indices.
template <class T>
struct VoxelSampler {
    const imaging::Volume& image;
    int channels = image.channels();
    std::array<std::int64_t, 3> stride{channels, channels* std::int64_t{image.geometry.size[0]},
                                       channels* std::int64_t{image.geometry.size[0]} * image.geometry.size[1]};

    void nearest(const Eigen::Vector3d& index, T* target) const {
        const T* voxel = image.data<T>();
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const int rounded = static_cast<int>(std::floor(index[static_cast<Eigen::Index>(axis)] + 0.5));
            voxel += stride[axis] * std::clamp(rounded, 0, image.geometry.size[axis] - 1);
        }
        std::copy_n(voxel, channels, target);
    }

    void linear(const Eigen::Vector3d& index, T* target) const {
        const T* corner = image.data<T>();
        std::array<std::int64_t, 3> next;  // to the neighbour along each axis, 0 where there is none
        std::array<double, 3> f;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const int last = image.geometry.size[axis] - 1;
            const double clamped =
                std::min(std::max(index[static_cast<Eigen::Index>(axis)], 0.0), static_cast<double>(last));
            const int lower = static_cast<int>(clamped);
            f[axis] = clamped - lower;
            corner += stride[axis] * lower;
            next[axis] = lower < last ? stride[axis] : 0;
        }
        const auto row = [&](const T* p) {
            const double left = p[0];
            return left + f[0] * (p[next[0]] - left);
        };
        const auto slice = [&](const T* p) {
            const double near = row(p);
            return near + f[1] * (row(p + next[1]) - near);
        };
        for (int c = 0; c < channels; ++c) {
            const double near = slice(corner + c);
            target[c] = cv::saturate_cast<T>(near + f[2] * (slice(corner + c + next[2]) - near));
        }
    }
};

}  // namespace tissuewarp::registration::detail
