#include "registration/warp.hpp"

#include "core/errors.hpp"
#include "registration/detail/uninitialised.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace tissuewarp::registration {

namespace {

using imaging::Geometry;
using imaging::Volume;

void require_inputs(const Volume& moving, const Volume& field, const char* what) {
    const std::string who = std::string(what) + ": ";
    if (moving.empty()) throw InvalidInput(who + "the moving image is empty; give one with voxels");
    if (field.empty() || field.voxels.type() != CV_32FC3)
        throw InvalidInput(who + "the field must have three channels of float32; give displacement_fixed_to_moving");
    imaging::require_valid(moving.geometry, "moving image");
    imaging::require_valid(field.geometry, "field");
}

/// Half a voxel beyond the outermost centres still belongs to the image, as in imaging::resample.
bool holds(const Geometry& grid, const Eigen::Vector3d& index) {
    for (int axis = 0; axis < 3; ++axis)
        if (!(index[axis] >= -0.5 - 1e-6 && index[axis] <= grid.size[axis] - 0.5 + 1e-6)) return false;
    return true;
}

/// The moving voxel grid, read at continuous indices.
template <class T>
struct Sampler {
    const Volume& image;
    int channels = image.channels();

    void nearest(const Eigen::Vector3d& index, T* target) const {
        std::array<int, 3> voxel;
        for (int axis = 0; axis < 3; ++axis)
            voxel[axis] = std::clamp(static_cast<int>(std::floor(index[axis] + 0.5)), 0, image.geometry.size[axis] - 1);
        std::copy_n(image.data<T>() + channels * image.offset(voxel[0], voxel[1], voxel[2]), channels, target);
    }

    void linear(const Eigen::Vector3d& index, T* target) const {
        std::array<int, 3> lower, upper;
        Eigen::Vector3d f;
        for (int axis = 0; axis < 3; ++axis) {
            const int last = image.geometry.size[axis] - 1;
            const double clamped = std::clamp(index[axis], 0.0, static_cast<double>(last));
            lower[axis] = static_cast<int>(clamped);
            upper[axis] = std::min(lower[axis] + 1, last);
            f[axis] = clamped - lower[axis];
        }
        const auto row = [&](int j, int k, int c) {
            const T* start = image.data<T>() + channels * image.offset(0, j, k) + c;
            const double left = start[channels * lower[0]];
            return left + f[0] * (start[channels * upper[0]] - left);
        };
        const auto slice = [&](int k, int c) {
            const double near = row(lower[1], k, c);
            return near + f[1] * (row(upper[1], k, c) - near);
        };
        for (int c = 0; c < channels; ++c) {
            const double near = slice(lower[2], c);
            target[c] = cv::saturate_cast<T>(near + f[2] * (slice(upper[2], c) - near));
        }
    }
};

enum class Kernel { Nearest, Linear };

template <class T>
void pull(const Volume& moving, const Volume& field, Kernel kernel, double outside, Volume& result) {
    const Geometry& grid = field.geometry;
    const Eigen::Matrix3d to_index = moving.geometry.point_to_index();
    const Eigen::Vector3d step = to_index * grid.index_to_point().col(0);
    const Sampler<T> sampler{moving};
    const T outside_value = cv::saturate_cast<T>(outside);
    tbb::parallel_for(0, grid.size[1] * grid.size[2], [&](int row) {
        const int j = row % grid.size[1], k = row / grid.size[1];
        const cv::Vec3f* displacement = field.data<cv::Vec3f>() + field.offset(0, j, k);
        T* target = result.data<T>() + sampler.channels * result.offset(0, j, k);
        const Eigen::Vector3d start = to_index * (grid.point(Eigen::Vector3d(0, j, k)) - moving.geometry.origin);
        for (int i = 0; i < grid.size[0]; ++i, target += sampler.channels) {
            const Eigen::Vector3d d(displacement[i][0], displacement[i][1], displacement[i][2]);
            const Eigen::Vector3d index = start + i * step + to_index * d;
            if (!holds(moving.geometry, index))
                std::fill_n(target, sampler.channels, outside_value);
            else if (kernel == Kernel::Linear)
                sampler.linear(index, target);
            else
                sampler.nearest(index, target);
        }
    });
}

Volume warp(const Volume& moving, const Volume& field, Kernel kernel, double outside) {
    Volume result = detail::uninitialised(field.geometry, moving.voxels.type());
    switch (moving.voxels.depth()) {
        case CV_8U:
            pull<std::uint8_t>(moving, field, kernel, outside, result);
            break;
        case CV_8S:
            pull<std::int8_t>(moving, field, kernel, outside, result);
            break;
        case CV_16U:
            pull<std::uint16_t>(moving, field, kernel, outside, result);
            break;
        case CV_16S:
            pull<std::int16_t>(moving, field, kernel, outside, result);
            break;
        case CV_32S:
            pull<std::int32_t>(moving, field, kernel, outside, result);
            break;
        case CV_32F:
            pull<float>(moving, field, kernel, outside, result);
            break;
        case CV_64F:
            pull<double>(moving, field, kernel, outside, result);
            break;
        default:
            throw InvalidInput("warp: voxels of half precision; convert them to float32");
    }
    return result;
}

}  // namespace

Volume warp_image(const Volume& moving, const Volume& fixed_to_moving, double outside) {
    require_inputs(moving, fixed_to_moving, "warp_image");
    return warp(moving, fixed_to_moving, Kernel::Linear, outside);
}

Volume warp_labels(const Volume& moving_labels, const Volume& fixed_to_moving) {
    require_inputs(moving_labels, fixed_to_moving, "warp_labels");
    if (moving_labels.voxels.depth() >= CV_32F)
        throw InvalidInput("warp_labels: labels are floating-point; read them with read_labels");
    return warp(moving_labels, fixed_to_moving, Kernel::Nearest, 0.0);
}

}  // namespace tissuewarp::registration
