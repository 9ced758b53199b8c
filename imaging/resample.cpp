#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/voxel_type.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace tissuewarp::imaging {

namespace {

/// Rounding of header digits must not push the outermost half voxel outside.
constexpr double edge_tolerance = 1e-6;

/// Continuous index of each output voxel along one row: start + i * step.
struct Row {
    Eigen::Vector3d start, step;
};

bool inside(const Eigen::Vector3d& index, const std::array<int, 3>& size) {
    for (int axis = 0; axis < 3; ++axis)
        if (!(index[axis] >= -0.5 - edge_tolerance && index[axis] <= size[axis] - 0.5 + edge_tolerance)) return false;
    return true;
}

template <class T>
void nearest(const Volume& image, const Eigen::Vector3d& index, int channels, T* target) {
    std::array<int, 3> voxel;
    for (int axis = 0; axis < 3; ++axis)
        voxel[axis] = std::clamp(static_cast<int>(std::floor(index[axis] + 0.5)), 0, image.geometry.size[axis] - 1);
    const T* source = image.voxels.ptr<T>() + channels * image.offset(voxel[0], voxel[1], voxel[2]);
    std::copy_n(source, channels, target);
}

template <class T>
void linear(const Volume& image, const Eigen::Vector3d& index, int channels, T* target) {
    std::array<std::int64_t, 3> step{1, image.geometry.size[0],
                                     std::int64_t{image.geometry.size[0]} * image.geometry.size[1]};
    std::array<double, 3> fraction;
    std::int64_t base = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const int last = image.geometry.size[axis] - 1;
        const double clamped = std::clamp(index[axis], 0.0, static_cast<double>(last));
        const int lower = std::min(static_cast<int>(clamped), std::max(last - 1, 0));
        fraction[axis] = clamped - lower;
        base += lower * step[axis];
        step[axis] *= last > 0 ? channels : 0;
    }
    const T* corner = image.voxels.ptr<T>() + channels * base;
    for (int c = 0; c < channels; ++c) {
        const auto along_i = [&](const T* p) { return p[c] + fraction[0] * (double{1} * p[c + step[0]] - p[c]); };
        const auto along_j = [&](const T* p) {
            const double first = along_i(p);
            return first + fraction[1] * (along_i(p + step[1]) - first);
        };
        const double first = along_j(corner);
        target[c] = cv::saturate_cast<T>(first + fraction[2] * (along_j(corner + step[2]) - first));
    }
}

template <class T, class Kernel>
void fill(const Volume& image, Volume& result, double outside, const Kernel& kernel) {
    const Geometry &from = image.geometry, &to = result.geometry;
    const Eigen::Matrix3d matrix = from.point_to_index() * to.index_to_point();
    const Eigen::Vector3d start = from.index(to.origin);
    const int channels = image.channels();
    const T outside_value = cv::saturate_cast<T>(outside);
    tbb::parallel_for(0, to.size[2], [&](int k) {
        for (int j = 0; j < to.size[1]; ++j) {
            const Row row{start + matrix.col(1) * j + matrix.col(2) * k, matrix.col(0)};
            T* target = result.voxels.ptr<T>() + channels * result.offset(0, j, k);
            for (int i = 0; i < to.size[0]; ++i, target += channels) {
                const Eigen::Vector3d index = row.start + row.step * i;
                if (inside(index, from.size))
                    kernel(image, index, channels, target);
                else
                    std::fill_n(target, channels, outside_value);
            }
        }
    });
}

template <class T>
void resample_as(const Volume& image, Volume& result, Interpolation interpolation, double outside) {
    if (interpolation == Interpolation::Nearest)
        fill<T>(image, result, outside, nearest<T>);
    else
        fill<T>(image, result, outside, linear<T>);
}

}  // namespace

Volume resample(const Volume& image, const Geometry& grid, Interpolation interpolation, double outside) {
    if (image.empty()) throw InvalidInput("resample: the image is empty; give one with voxels");
    Volume result(grid, image.voxels.type());
    with_voxel_type(image, "resample",
                    [&](auto type) { resample_as<decltype(type)>(image, result, interpolation, outside); });
    return result;
}

Volume crop(const Volume& image, const std::array<int, 3>& lower, const std::array<int, 3>& upper) {
    Geometry grid = image.geometry;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        if (lower[axis] < 0 || upper[axis] > image.geometry.size[axis] || lower[axis] >= upper[axis])
            throw InvalidInput("crop: voxels [" + std::to_string(lower[axis]) + ", " + std::to_string(upper[axis]) +
                               ") along axis " + std::to_string(axis) + " of an image of " +
                               std::to_string(image.geometry.size[axis]) + "; give a box inside the image");
        grid.size[axis] = upper[axis] - lower[axis];
    }
    grid.origin = image.geometry.point(Eigen::Vector3d(lower[0], lower[1], lower[2]));
    const cv::Range ranges[3] = {{lower[2], upper[2]}, {lower[1], upper[1]}, {lower[0], upper[0]}};
    return {grid, image.voxels(ranges).clone()};
}

}  // namespace tissuewarp::imaging
