#pragma once
/// Values of a volume between its voxels, for inner loops: no allocation, no checks, safe to call from many threads.

#include "core/errors.hpp"
#include "imaging/volume.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace tissuewarp::imaging {

/// Trilinear interpolation of a float32 scalar volume, clamped at the border: beyond the outermost voxel centres the
/// value is that of the nearest point of the grid. Holds a reference to the voxels, as copies of cv::Mat do.
class LinearSampler {
public:
    struct ValueAndGradient {
        double value;
        Eigen::Vector3d gradient;  ///< LPS, per mm; 0 across a border that clamps
    };

    /// Throws InvalidInput unless the volume is float32 with one component and two voxels or more along each axis.
    explicit LinearSampler(const Volume& volume) : volume_(volume) {
        const auto& size = volume.geometry.size;
        if (volume.voxels.type() != CV_32FC1 || *std::min_element(size.begin(), size.end()) < 2)
            throw InvalidInput(
                "linear sampler: give a float32 volume of one component, two voxels or more along each axis");
        values_ = volume_.voxels.ptr<float>();
        to_index_ = volume.geometry.point_to_index();
        shift_ = -to_index_ * volume.geometry.origin;
        stride_ = {1, size[0], std::int64_t{size[0]} * size[1]};
    }

    /// Continuous index (voxel) of an LPS point (mm).
    [[nodiscard]] Eigen::Vector3d index(const Eigen::Vector3d& point) const { return to_index_ * point + shift_; }

    /// True when the point lies in the box of the voxels, half a voxel beyond the outermost centres included.
    [[nodiscard]] bool contains(const Eigen::Vector3d& point) const {
        const Eigen::Vector3d at = index(point);
        for (std::size_t axis = 0; axis < 3; ++axis)
            if (!(at[axis] >= -0.5 && at[axis] <= volume_.geometry.size[axis] - 0.5)) return false;
        return true;
    }

    /// Value at an LPS point (mm).
    [[nodiscard]] double value(const Eigen::Vector3d& point) const {
        const Cell cell = cell_at(index(point));
        const float* p = values_ + cell.base;
        const double u = cell.fraction[0];
        const double a = mix(p[0], p[1], u), b = mix(p[stride_[1]], p[stride_[1] + 1], u);
        p += stride_[2];
        const double c = mix(p[0], p[1], u), d = mix(p[stride_[1]], p[stride_[1] + 1], u);
        return mix(mix(a, b, cell.fraction[1]), mix(c, d, cell.fraction[1]), cell.fraction[2]);
    }

    /// Value and exact gradient of the trilinear function at an LPS point (mm).
    [[nodiscard]] ValueAndGradient value_and_gradient(const Eigen::Vector3d& point) const {
        const Cell cell = cell_at(index(point));
        const float* p = values_ + cell.base;
        const double u = cell.fraction[0], v = cell.fraction[1], w = cell.fraction[2];
        const double a = mix(p[0], p[1], u), da = p[1] - p[0];
        const double b = mix(p[stride_[1]], p[stride_[1] + 1], u), db = p[stride_[1] + 1] - p[stride_[1]];
        p += stride_[2];
        const double c = mix(p[0], p[1], u), dc = p[1] - p[0];
        const double d = mix(p[stride_[1]], p[stride_[1] + 1], u), dd = p[stride_[1] + 1] - p[stride_[1]];
        const double ab = mix(a, b, v), cd = mix(c, d, v);
        const Eigen::Vector3d by_index(mix(mix(da, db, v), mix(dc, dd, v), w), mix(b - a, d - c, w), cd - ab);
        return {mix(ab, cd, w), to_index_.transpose() * by_index.cwiseProduct(cell.free)};
    }

private:
    struct Cell {
        std::int64_t base;
        Eigen::Vector3d fraction;
        Eigen::Vector3d free;  ///< 0 where the index was clamped
    };

    static double mix(double a, double b, double t) { return a + t * (b - a); }

    [[nodiscard]] Cell cell_at(const Eigen::Vector3d& index) const {
        Cell cell{0, {}, {}};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const int last = volume_.geometry.size[axis] - 1;
            // Written so that NaN lands on 0: a point that is not finite must not reach beyond the memory.
            const double clamped = index[axis] > 0.0 ? std::min<double>(index[axis], last) : 0.0;
            const int lower = std::min(static_cast<int>(clamped), last - 1);
            cell.base += lower * stride_[axis];
            cell.fraction[axis] = clamped - lower;
            cell.free[axis] = clamped == index[axis] ? 1.0 : 0.0;
        }
        return cell;
    }

    Volume volume_;
    const float* values_ = nullptr;
    Eigen::Matrix3d to_index_;
    Eigen::Vector3d shift_;
    std::array<std::int64_t, 3> stride_{};
};

/// Value of the voxel nearest to an LPS point (mm) in a scalar volume of type T, or `outside` beyond the voxels' box.
/// The geometry is inverted on every call: not for inner loops.
template <class T>
[[nodiscard]] T nearest_value(const Volume& volume, const Eigen::Vector3d& point, T outside = T{}) {
    const Eigen::Vector3d index = volume.geometry.index(point);
    std::array<int, 3> voxel;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double rounded = std::floor(index[axis] + 0.5);
        if (!(rounded >= 0.0 && rounded < volume.geometry.size[axis])) return outside;
        voxel[axis] = static_cast<int>(rounded);
    }
    return volume.data<T>()[volume.offset(voxel[0], voxel[1], voxel[2])];
}

}  // namespace tissuewarp::imaging
