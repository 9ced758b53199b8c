#include "simulation/obstacles.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "simulation/surface_distance.hpp"
#include "tled/nodal_effects.hpp"

#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>

namespace tissuewarp::simulation {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using tled::DistanceGrid;

constexpr double reach = 0.25;      // of the tissue's extent, by which it may move
constexpr double inwards = 10;      // mm, by which it may enter a body all around it
constexpr int finest_samples = 48;  // along the longest side of grids that are not given

struct Extent {
    Vector3d lower, upper;
    [[nodiscard]] Vector3d size() const { return upper - lower; }
};

Extent where_tissue_may_be(const Contact& contact, const Matrix3Xd& tissue) {
    Extent extent{tissue.rowwise().minCoeff(), tissue.rowwise().maxCoeff()};
    const bool around = std::holds_alternative<OutsideOfLabels>(contact.body);
    const double margin = (around ? inwards : reach * extent.size().norm()) + contact.gap + contact.motion.norm();
    extent.lower.array() -= margin;
    extent.upper.array() += margin;
    return extent;
}

DistanceGrid sampled(const Extent& extent, double spacing, const std::function<double(const Vector3d&)>& distance) {
    DistanceGrid grid;
    grid.origin = extent.lower.array() - spacing;  // the outermost samples have no distance of their own
    grid.steps = spacing * Eigen::Matrix3d::Identity();
    grid.size = (extent.size() / spacing).array().ceil().cast<int>() + 4;
    grid.distance.resize(static_cast<std::size_t>(grid.size.cast<long>().prod()));
    tbb::parallel_for(0, grid.size[2], [&](int k) {
        auto at = static_cast<std::size_t>(k) * static_cast<std::size_t>(grid.size[0] * grid.size[1]);
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i)
                grid.distance[at++] = static_cast<float>(distance(grid.origin + spacing * Vector3d(i, j, k)));
    });
    return grid;
}

double finest_spacing(const Extent& extent) {
    return extent.size().maxCoeff() / finest_samples;
}

DistanceGrid grid_of(const HalfSpace& body, const Extent& extent) {
    // A linear function, which cubic convolution reproduces from any samples.
    return sampled(extent, extent.size().maxCoeff() / 6,
                   [&](const Vector3d& x) { return (x - body.point).dot(body.normal); });
}

DistanceGrid grid_of(const Ball& body, const Extent& extent) {
    const double margin = std::max(body.radius, 0.1 * extent.size().norm());
    const Extent around{body.centre.array() - body.radius - margin, body.centre.array() + body.radius + margin};
    return sampled(around, finest_spacing(around),
                   [&](const Vector3d& x) { return (x - body.centre).norm() - body.radius; });
}

DistanceGrid grid_of(const meshing::SurfaceMesh& body, const Extent& extent) {
    const SurfaceDistance distance(body);
    return sampled(extent, finest_spacing(extent), distance);
}

/// Distances to voxels that are not 0, smoothed by a voxel so that steps of the label map are none of the surface.
DistanceGrid grid_of_mask(const imaging::Volume& mask) {
    const double voxel = mask.geometry.spacing.maxCoeff();
    const imaging::Volume distance = imaging::smooth(imaging::signed_distance(mask), voxel);
    DistanceGrid grid;
    grid.origin = distance.geometry.origin;
    grid.steps = distance.geometry.index_to_point();
    grid.size = Eigen::Map<const Eigen::Vector3i>(distance.geometry.size.data());
    grid.distance.assign(distance.data<float>(), distance.data<float>() + distance.voxels.total());
    return grid;
}

/// The part of a volume, and what is beyond its edge as `beyond`, that covers the extent: voxels for which `solid`.
imaging::Volume mask_around(const imaging::Volume& labels, const Extent& extent, const std::function<bool(int)>& solid,
                            bool beyond) {
    Vector3d first = Vector3d::Constant(std::numeric_limits<double>::infinity()), last = -first;
    for (int corner = 0; corner < 8; ++corner) {
        Vector3d point = extent.lower;
        for (int axis = 0; axis < 3; ++axis)
            if (corner >> axis & 1) point[axis] = extent.upper[axis];
        const Vector3d index = labels.geometry.index(point);
        first = first.cwiseMin(index);
        last = last.cwiseMax(index);
    }
    imaging::Geometry grid = labels.geometry;
    const Vector3d start = first.array().floor() - 1;  // the outermost voxels have no distance of their own
    grid.origin = labels.geometry.point(start);
    for (std::size_t axis = 0; axis < 3; ++axis)
        grid.size[axis] = static_cast<int>(std::ceil(last[static_cast<int>(axis)]) - start[static_cast<int>(axis)]) + 3;
    imaging::Volume mask(grid, CV_8UC1);
    const auto& size = labels.geometry.size;
    std::size_t at = 0;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i, ++at) {
                const Eigen::Vector3i voxel = start.cast<int>() + Eigen::Vector3i(i, j, k);
                const bool inside =
                    voxel.minCoeff() >= 0 && voxel[0] < size[0] && voxel[1] < size[1] && voxel[2] < size[2];
                const bool body =
                    inside ? solid(labels.data<std::int32_t>()[labels.offset(voxel[0], voxel[1], voxel[2])]) : beyond;
                mask.data<std::uint8_t>()[at] = body ? 1 : 0;
            }
    return mask;
}

const imaging::Volume& required(const imaging::Volume* labels) {
    if (!labels) throw InvalidInput("a contact names labels of a volume, and the scene has none; give geometry.labels");
    return *labels;
}

DistanceGrid grid_of(const ObstacleLabel& body, const Extent& extent, const imaging::Volume* labels) {
    return grid_of_mask(mask_around(
        required(labels), extent, [&](int label) { return label == body.label; }, false));
}

DistanceGrid grid_of(const OutsideOfLabels& body, const Extent& extent, const imaging::Volume* labels) {
    const auto solid = [&](int label) {
        return std::find(body.labels.begin(), body.labels.end(), label) == body.labels.end();
    };
    return grid_of_mask(mask_around(required(labels), extent, solid, true));
}

/// Makes the body smaller by `gap`, and by what overlaps.
void make_room(tled::Obstacle& obstacle, const Contact& contact, const Matrix3Xd& tissue, double most,
               Observer& observer) {
    double deepest = 0;
    for (Eigen::Index n = 0; n < tissue.cols(); ++n)
        deepest = std::max(deepest, -tled::distance_to(obstacle, tissue.col(n)).value - contact.gap);
    if (deepest > most)
        throw InvalidInput("a body that the tissue is in contact with overlaps it by " + std::to_string(deepest) +
                           " mm at rest, more than " + std::to_string(most) +
                           " mm that the mesh explains; move it, or give gap_mm");
    if (deepest > 0)
        observer.note("a body overlapped the tissue at rest by up to " + std::to_string(deepest) +
                      " mm and was made smaller by as much");
    DistanceGrid smaller = *obstacle.surface;
    for (float& distance : smaller.distance) distance += static_cast<float>(deepest + contact.gap);
    obstacle.surface = std::move(smaller);
}

}  // namespace

tled::Obstacle obstacle(const Contact& contact, const Matrix3Xd& tissue, double overlap, const imaging::Volume* labels,
                        Observer& observer) {
    const Extent extent = where_tissue_may_be(contact, tissue);
    tled::Obstacle result;
    result.surface = std::visit(
        [&](const auto& body) {
            if constexpr (requires { grid_of(body, extent, labels); })
                return grid_of(body, extent, labels);
            else
                return grid_of(body, extent);
        },
        contact.body);
    result.friction = contact.friction;
    make_room(result, contact, tissue, overlap, observer);
    return result;
}

}  // namespace tissuewarp::simulation
