#include "simulation/obstacles.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/sampling.hpp"
#include "simulation/surface_distance.hpp"
#include "tled/nodal_effects.hpp"

#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
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

Vector3d corner_of(const Extent& extent, int corner) {
    Vector3d point = extent.lower;
    for (int axis = 0; axis < 3; ++axis)
        if (corner >> axis & 1) point[axis] = extent.upper[axis];
    return point;
}

Extent widened(const Extent& extent, double margin) {
    return {extent.lower.array() - margin, extent.upper.array() + margin};
}

/// What an extent covers as seen from a body that turns through the parts of its motion.
Extent seen_from_turning(const Extent& extent, const RigidMotion& motion, const CurveRange& parts) {
    const double angle = motion.turn.norm();
    if (!(angle > 0)) return extent;
    const double way = std::min(angle * (parts.largest - parts.least), 2 * std::numbers::pi);
    const int arcs = std::max(1, static_cast<int>(std::ceil(way / 0.1)));
    const RigidMotion turn{Vector3d::Zero(), motion.turn, motion.point};
    Extent seen{Vector3d::Constant(std::numeric_limits<double>::infinity()),
                Vector3d::Constant(-std::numeric_limits<double>::infinity())};
    double furthest = 0;
    for (int end = 0; end <= arcs; ++end) {
        const auto [shift, rotation] = placement_at(turn, parts.least + way / angle * end / arcs);
        for (int corner = 0; corner < 8; ++corner) {
            const Vector3d point = rotation.transpose() * (corner_of(extent, corner) - shift);
            furthest = std::max(furthest, distance_from_axis(motion, point));
            seen.lower = seen.lower.cwiseMin(point);
            seen.upper = seen.upper.cwiseMax(point);
        }
    }
    // By as much an arc stands out over its chord.
    return widened(seen, furthest * way * way / (8.0 * arcs * arcs));
}

/// As seen from the body.
Extent where_tissue_may_be(const Contact& contact, const Matrix3Xd& tissue) {
    const Extent extent{tissue.rowwise().minCoeff(), tissue.rowwise().maxCoeff()};
    const bool around = std::holds_alternative<OutsideOfLabels>(contact.body);
    const CurveRange parts = range_of(contact.curve);
    const double way = std::max(std::abs(parts.least), std::abs(parts.largest)) * contact.motion.displacement.norm();
    const double margin = (around ? inwards : reach * extent.size().norm()) + contact.gap + way;
    return seen_from_turning(widened(extent, margin), contact.motion, parts);
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

/// The same without an end along the plane: its axes are two of the plane, along which nothing changes, and the normal.
DistanceGrid endless_grid_of(const HalfSpace& body, const Extent& extent) {
    constexpr double far = 1e6;  // mm, from sample to sample along the plane
    constexpr int samples = 10;
    double lower = 0, upper = 0;  // of the distance, the plane included
    for (int corner = 0; corner < 8; ++corner) {
        const double distance = (corner_of(extent, corner) - body.point).dot(body.normal);
        lower = std::min(lower, distance);
        upper = std::max(upper, distance);
    }
    const double spacing = (upper - lower) / (samples - 4);
    const Vector3d along = body.normal.unitOrthogonal(), across = body.normal.cross(along);
    DistanceGrid grid;
    grid.steps << far * along, far * across, spacing * body.normal;
    grid.size = Eigen::Vector3i::Constant(samples);
    const double first = lower - 1.5 * spacing;
    grid.origin = body.point + first * body.normal - 0.5 * (samples - 1) * far * (along + across);
    for (int k = 0; k < samples; ++k)
        grid.distance.insert(grid.distance.end(), samples * samples, static_cast<float>(first + k * spacing));
    return grid;
}

DistanceGrid grid_of(const Ball& body, const Extent& extent) {
    const double margin = std::max(body.radius, 0.1 * extent.size().norm());
    const Extent around{body.centre.array() - body.radius - margin, body.centre.array() + body.radius + margin};
    return sampled(around, finest_spacing(around),
                   [&](const Vector3d& x) { return (x - body.centre).norm() - body.radius; });
}

DistanceGrid grid_of(const meshing::SurfaceMesh& body, const Extent& extent) {
    const SurfaceDistance distance(body);
    // A tool that turns passes through much space, of which it fills little.
    const Extent body_alone{body.nodes.rowwise().minCoeff(), body.nodes.rowwise().maxCoeff()};
    const Extent around = widened(body_alone, 0.1 * std::max(extent.size().norm(), body_alone.size().norm()));
    const Extent both{extent.lower.cwiseMax(around.lower), extent.upper.cwiseMin(around.upper)};
    const Extent& covered = both.size().minCoeff() > 0 ? both : extent;
    return sampled(covered, finest_spacing(covered), distance);
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
        const Vector3d index = labels.geometry.index(corner_of(extent, corner));
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

using IsInside = std::function<bool(const Vector3d&)>;

IsInside inside_of(const HalfSpace& body, const imaging::Volume*) {
    return [&](const Vector3d& x) { return (x - body.point).dot(body.normal) < 0; };
}

IsInside inside_of(const Ball& body, const imaging::Volume*) {
    return [&](const Vector3d& x) { return (x - body.centre).norm() < body.radius; };
}

IsInside inside_of(const meshing::SurfaceMesh& body, const imaging::Volume*) {
    return [distance = SurfaceDistance(body)](const Vector3d& x) { return distance(x) < 0; };
}

IsInside inside_of(const ObstacleLabel& body, const imaging::Volume* labels) {
    return
        [&body, labels](const Vector3d& x) { return imaging::nearest_value<std::int32_t>(*labels, x) == body.label; };
}

IsInside inside_of(const OutsideOfLabels& body, const imaging::Volume* labels) {
    return [&body, labels](const Vector3d& x) {
        const int label = imaging::nearest_value<std::int32_t>(*labels, x);  // 0 off the volume
        return std::find(body.labels.begin(), body.labels.end(), label) == body.labels.end();
    };
}

/// Makes the body smaller by `gap`, and by what overlaps.
void make_room(tled::Obstacle& obstacle, const Contact& contact, const Matrix3Xd& tissue, double most,
               Observer& observer) {
    double deepest = 0;
    for (Eigen::Index n = 0; n < tissue.cols(); ++n)
        deepest = std::max(deepest, -tled::distance_to(obstacle, tissue.col(n)).value - contact.gap);
    if (deepest > most)
        throw InvalidInput("a body that the tissue is in contact with overlaps it by " + std::to_string(deepest) +
                           " mm at the beginning, more than " + std::to_string(most) +
                           " mm that the mesh explains; move it, or give gap_mm");
    if (deepest > 0)
        observer.note("a body overlapped the tissue at the beginning by up to " + std::to_string(deepest) +
                      " mm and was made smaller by as much");
    DistanceGrid smaller = *obstacle.surface;
    for (float& distance : smaller.distance) distance += static_cast<float>(deepest + contact.gap);
    obstacle.surface = std::move(smaller);
}

}  // namespace

tled::Obstacle obstacle(const Contact& contact, const Matrix3Xd& tissue, double overlap, const imaging::Volume* labels,
                        Observer& observer) {
    const Extent extent = where_tissue_may_be(contact, tissue);
    const auto* const plane = std::get_if<HalfSpace>(&contact.body);
    tled::Obstacle result;
    result.surface = plane && contact.motion.turn.isZero(0.0)
                         ? endless_grid_of(*plane, extent)
                         : std::visit(
                               [&](const auto& body) {
                                   if constexpr (requires { grid_of(body, extent, labels); })
                                       return grid_of(body, extent, labels);
                                   else
                                       return grid_of(body, extent);
                               },
                               contact.body);
    result.friction = contact.friction;
    result.placement = placement_at(contact.motion, value_at(contact.curve, 0.0, 1.0));  // whatever the duration
    make_room(result, contact, tissue, overlap, observer);
    return result;
}

int passed_unseen(const Contact& contact, const tled::Obstacle& obstacle, const Matrix3Xd& rest,
                  const Matrix3Xd& places, const imaging::Volume* labels) {
    const auto& [shift, rotation] = obstacle.placement;
    const Matrix3Xd from = rotation.transpose() * (rest.colwise() - shift),  // as seen from the body
        to = rotation.transpose() * (places.colwise() - shift);
    const DistanceGrid& grid = *obstacle.surface;
    const Matrix3Xd index = grid.steps.inverse() * (to.colwise() - grid.origin);
    std::vector<Eigen::Index> beyond;
    for (Eigen::Index n = 0; n < index.cols(); ++n) {
        const auto x = index.col(n).array();
        if ((x < 1).any() || (x > grid.size.cast<double>().array() - 2).any()) beyond.push_back(n);
    }
    if (beyond.empty()) return 0;
    const IsInside inside = std::visit([&](const auto& body) { return inside_of(body, labels); }, contact.body);
    const bool endless = std::holds_alternative<HalfSpace>(contact.body) || std::holds_alternative<Ball>(contact.body);
    const double spacing = grid.steps.colwise().norm().minCoeff();
    return static_cast<int>(std::count_if(beyond.begin(), beyond.end(), [&](Eigen::Index n) {
        const Vector3d way = to.col(n) - from.col(n);
        const int steps = endless ? 1 : 1 + static_cast<int>(way.norm() / spacing);
        for (int step = steps; step > 0; --step)
            if (inside(from.col(n) + way * step / steps)) return true;
        return false;
    }));
}

double surface_reach(const DistanceGrid& grid, const RigidMotion& motion) {
    if (motion.turn.isZero(0.0)) return 0.0;
    // A cell that the surface goes through has no corner further from it than its own diagonal, and none of its points
    // is further from the axis than its corners.
    const double diagonal = grid.steps.colwise().norm().sum();
    double reach = 0;
    std::size_t at = 0;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i, ++at)
                if (std::abs(double{grid.distance[at]}) <= diagonal)
                    reach = std::max(reach, distance_from_axis(motion, grid.origin + grid.steps * Vector3d(i, j, k)));
    return reach;
}

}  // namespace tissuewarp::simulation
