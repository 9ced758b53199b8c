#include "registration/warp.hpp"

#include "core/errors.hpp"
#include "registration/field/uninitialised.hpp"

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
