#include "registration/warp.hpp"

#include "core/errors.hpp"
#include "imaging/voxel_type.hpp"
#include "registration/field/rasterisation.hpp"
#include "registration/field/uninitialised.hpp"
#include "registration/field/voxel_sampler.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

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

using detail::holds;
using detail::VoxelSampler;

enum class Kernel { Nearest, Linear };

template <class T>
void pull(const Volume& moving, const Volume& field, Kernel kernel, double outside, Volume& result) {
    const Geometry& grid = field.geometry;
    const Eigen::Matrix3d to_index = moving.geometry.point_to_index();
    const Eigen::Vector3d step = to_index * grid.index_to_point().col(0);
    const VoxelSampler<T> sampler{moving};
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
    imaging::with_voxel_type(moving, "warp",
                             [&](auto type) { pull<decltype(type)>(moving, field, kernel, outside, result); });
    return result;
}

template <class T>
void read(const VoxelSampler<T>& sampler, const Eigen::Vector3d& index, T outside, T* target) {
    if (holds(sampler.image.geometry, index))
        sampler.linear(index, target);
    else
        std::fill_n(target, sampler.channels, outside);
}

/// Voxels in the mesh, of the lowest element where several hold one, and which they are.
template <class T>
std::vector<std::uint8_t> pull_inside(const VoxelSampler<T>& sampler, const Deformation& deformation, T outside,
                                      Volume& result) {
    const Geometry &grid = result.geometry, &moving = sampler.image.geometry;
    const Eigen::Matrix3Xd from = moving.point_to_index() * (deformation.mesh.nodes.colwise() - moving.origin);
    const Eigen::Matrix3Xd to = grid.point_to_index() * (deformation.deformed_nodes().colwise() - grid.origin);
    std::vector<std::uint8_t> inside(static_cast<std::size_t>(grid.voxel_count()));
    detail::rasterise(to, deformation.mesh.tets, grid.size, [&](int tet, const Eigen::Vector4d& barycentric_step) {
        const Eigen::Matrix<double, 3, 4> corners = from(Eigen::all, deformation.mesh.tets.col(tet));
        const Eigen::Vector3d step = corners * barycentric_step;
        return [&, corners, step](const detail::TetRow& row) {
            const Eigen::Vector3d start = corners * row.at_first;
            const std::int64_t first = result.offset(row.first, row.j, row.k);
            for (int n = 0; n <= row.last - row.first; ++n) {
                std::uint8_t& seen = inside[static_cast<std::size_t>(first + n)];
                if (seen) continue;
                seen = 1;
                T* target = result.data<T>() + sampler.channels * (first + n);
                read(sampler, start + n * step, outside, target);
            }
        };
    });
    return inside;
}

/// The other voxels, where a rigid motion takes them from.
template <class T>
void pull_outside(const VoxelSampler<T>& sampler, const Eigen::Isometry3d& to_moving,
                  const std::vector<std::uint8_t>& inside, T outside, Volume& result) {
    const Geometry &grid = result.geometry, &moving = sampler.image.geometry;
    const Eigen::Matrix3d to_index = moving.point_to_index() * to_moving.linear();
    const Eigen::Vector3d step = to_index * grid.index_to_point().col(0);
    tbb::parallel_for(0, grid.size[1] * grid.size[2], [&](int row) {
        const int j = row % grid.size[1], k = row / grid.size[1];
        const Eigen::Vector3d start =
            moving.point_to_index() * (to_moving * grid.point(Eigen::Vector3d(0, j, k)) - moving.origin);
        const std::int64_t first = result.offset(0, j, k);
        for (int i = 0; i < grid.size[0]; ++i) {
            if (inside[static_cast<std::size_t>(first + i)]) continue;
            read(sampler, start + i * step, outside, result.data<T>() + sampler.channels * (first + i));
        }
    });
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

Volume warp_by_mesh(const Volume& moving, const Deformation& deformation, const Geometry& fixed_grid, double outside) {
    if (moving.empty()) throw InvalidInput("warp_by_mesh: the moving image is empty; give one with voxels");
    imaging::require_valid(moving.geometry, "moving image");
    imaging::require_valid(fixed_grid, "fixed grid");
    if (!deformation.displacement.allFinite() || !deformation.placement.matrix().allFinite())
        throw InvalidInput("warp_by_mesh: a displacement or the placement is not finite");
    Volume result = detail::uninitialised(fixed_grid, moving.voxels.type());
    imaging::with_voxel_type(moving, "warp", [&](auto type) {
        const VoxelSampler<decltype(type)> sampler{moving};
        const auto value = cv::saturate_cast<decltype(type)>(outside);
        const std::vector<std::uint8_t> inside = pull_inside(sampler, deformation, value, result);
        pull_outside(sampler, deformation.placement.inverse(), inside, value, result);
    });
    return result;
}

}  // namespace tissuewarp::registration
