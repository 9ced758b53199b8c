#include "registration/field/held_bodies.hpp"

#include "imaging/label_extents.hpp"
#include "imaging/places.hpp"

#include <cstdint>

namespace tissuewarp::registration::detail {

using imaging::Geometry;
using imaging::Volume;

std::vector<Eigen::Isometry3d> against_surroundings(const Surroundings& surroundings) {
    std::vector<Eigen::Isometry3d> motions;
    const Eigen::Isometry3d back = surroundings.motion.inverse();
    for (const Eigen::Isometry3d& motion : surroundings.bodies) motions.push_back(back * motion);
    return motions;
}

namespace {

/// Of voxels of the box, 3 × 8, as indices; a voxel more on each side, where it may end.
Eigen::Matrix<double, 3, 8> corners_of(const imaging::LabelExtent& box) {
    Eigen::Matrix<double, 3, 8> corners;
    for (int corner = 0; corner < 8; ++corner)
        for (std::size_t axis = 0; axis < 3; ++axis)
            corners(int(axis), corner) = corner >> axis & 1 ? box.upper[axis] : box.lower[axis] - 1;
    return corners;
}

}  // namespace

Eigen::Matrix3Xd HeldBodies::corners_of_moved() const {
    if (motions_.empty()) return Eigen::Matrix3Xd(3, 0);
    std::vector<Eigen::Vector3d> places;
    for (const auto& [body, box] : imaging::label_extents(mask_)) {
        if (body < 2) continue;
        const Eigen::Matrix<double, 3, 8> corners = corners_of(box);
        for (const auto& index : corners.colwise()) places.push_back(mask_.geometry.point(index));
    }
    Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(places.size()));
    for (std::size_t n = 0; n < places.size(); ++n) result.col(static_cast<Eigen::Index>(n)) = places[n];
    return result;
}

Geometry grown_by(const Volume& bodies, const std::vector<Eigen::Isometry3d>& motions) {
    const Geometry& grid = bodies.geometry;
    Eigen::Array3d lower = Eigen::Array3d::Zero(), upper(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
    for (const auto& [body, box] : imaging::label_extents(bodies)) {
        if (body < 2) continue;
        const Eigen::Isometry3d& motion = motions[static_cast<std::size_t>(body) - 2];
        const Eigen::Matrix<double, 3, 8> corners = corners_of(box);
        for (const auto& index : corners.colwise()) {
            const Eigen::Array3d moved = grid.index(motion * grid.point(index)).array();
            lower = lower.min(moved);
            upper = upper.max(moved);
        }
    }
    const Eigen::Array3i first = lower.floor().cast<int>(), last = upper.ceil().cast<int>();
    Geometry result = grid;
    result.origin = grid.point(first.cast<double>().matrix());
    for (int axis = 0; axis < 3; ++axis) result.size[static_cast<std::size_t>(axis)] = last[axis] - first[axis] + 1;
    return result;
}

HeldBodies held_before(const Deformation& deformation) {
    if (!deformation.surroundings) return {};
    return {deformation.surroundings->rigid, against_surroundings(*deformation.surroundings)};
}

HeldBodies held_after(const Deformation& deformation) {
    if (!deformation.surroundings) return {};
    const Volume& rigid = deformation.surroundings->rigid;
    std::vector<Eigen::Isometry3d> back = against_surroundings(*deformation.surroundings);
    if (back.empty()) return {rigid, {}};
    const Geometry grid = grown_by(rigid, back);
    for (Eigen::Isometry3d& motion : back) motion = motion.inverse();
    const imaging::MaskLookup before(rigid);
    Volume after(grid, CV_8UC1);
    imaging::for_each_place(grid, [&](const Eigen::Vector3d& z, std::int64_t n) {
        std::uint8_t& body = after.data<std::uint8_t>()[n];
        body = before.value(z) == 1 ? 1 : 0;
        for (std::size_t b = 0; b < back.size() && body == 0; ++b)
            if (before.value(back[b] * z) == b + 2) body = static_cast<std::uint8_t>(b + 2);
    });
    return {after, std::move(back)};
}

}  // namespace tissuewarp::registration::detail
