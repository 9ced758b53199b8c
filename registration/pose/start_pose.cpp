#include "registration/pose/start_pose.hpp"

#include "core/errors.hpp"
#include "imaging/sampling.hpp"
#include "registration/pose/rigid_part.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tissuewarp::registration {

namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

/// Enough for a rigid motion of any organ.
constexpr std::int64_t most_places = 20000;

template <class Visit>
void for_each_place(const imaging::Geometry& grid, std::int64_t stride, const Visit& visit) {
    const auto& size = grid.size;
    for (std::int64_t n = 0; n < grid.voxel_count(); n += stride) {
        const std::int64_t row = n / size[0];
        visit(n, grid.point({double(n % size[0]), double(row % size[1]), double(row / size[1])}));
    }
}

struct Places {
    std::vector<Vector3d> moving, fixed;

    [[nodiscard]] static Matrix3Xd matrix(const std::vector<Vector3d>& points) {
        Matrix3Xd result(3, static_cast<Eigen::Index>(points.size()));
        for (std::size_t n = 0; n < points.size(); ++n) result.col(static_cast<Eigen::Index>(n)) = points[n];
        return result;
    }
};

Places of_linear(const Eigen::Affine3d& to_moving, const imaging::Volume& organ) {
    if (!(to_moving.linear().determinant() > 1e-6))
        throw InvalidInput("it mirrors or flattens space (determinant " +
                           std::to_string(to_moving.linear().determinant()) + "); check its rows and columns");
    Places places;
    const Eigen::Affine3d to_fixed = to_moving.inverse();
    const std::int64_t stride = std::max<std::int64_t>(1, cv::countNonZero(organ.voxels.reshape(1, 1)) / most_places);
    std::int64_t labelled = 0;
    for_each_place(organ.geometry, 1, [&](std::int64_t n, const Vector3d& x) {
        if (organ.data<std::int32_t>()[n] == 0 || labelled++ % stride != 0) return;
        places.moving.push_back(x);
        places.fixed.push_back(to_fixed * x);
    });
    return places;
}

Places of_field(const PointMap& map, const imaging::Volume& organ) {
    Places places;
    const Eigen::Affine3d back = map.before.inverse();
    const auto* vectors = map.field->data<cv::Vec3f>();
    for_each_place(map.field->geometry, 1, [&](std::int64_t n, const Vector3d& z) {
        const Vector3d x = map.after * (z + Vector3d(vectors[n][0], vectors[n][1], vectors[n][2]));
        if (imaging::nearest_value<std::int32_t>(organ, x) == 0) return;
        places.moving.push_back(x);
        places.fixed.push_back(back * z);
    });
    return places;
}

}  // namespace

StartPose start_pose(const PointMap& map, const imaging::Volume& given) {
    const imaging::Volume organ = given.as(CV_32S);
    const Places places = map.field ? of_field(map, organ) : of_linear(map.after * map.before, organ);
    constexpr std::size_t fewest = 10;
    if (places.moving.size() < fewest)
        throw InvalidInput(
            "it takes hardly a point to the organ; check which way it maps: from fixed to moving points");
    const Matrix3Xd moving = Places::matrix(places.moving), fixed = Places::matrix(places.fixed);
    StartPose start;
    start.placement = detail::closest_motion(moving, fixed, Eigen::VectorXd::Ones(moving.cols()));
    const Eigen::RowVectorXd rest = ((start.placement * moving) - fixed).colwise().norm();
    start.deformation_mm = std::sqrt(rest.squaredNorm() / double(rest.size()));
    start.furthest_mm = rest.maxCoeff();
    return start;
}

namespace detail {

namespace {

imaging::Volume moved(const imaging::Volume& image, const Eigen::Isometry3d& motion) {
    imaging::Volume result = image;
    result.geometry.origin = motion * image.geometry.origin;
    result.geometry.direction = motion.linear() * image.geometry.direction;
    return result;
}

}  // namespace

Intraoperative seen_from(const Intraoperative& seen, const Eigen::Isometry3d& start) {
    const Eigen::Isometry3d back = start.inverse();
    Intraoperative result = seen;
    if (seen.labels) result.labels = moved(*seen.labels, back);
    if (seen.image) result.image = moved(*seen.image, back);
    for (imaging::Volume& contrast : result.contrasts) contrast = moved(contrast, back);
    if (seen.surface) {
        result.surface->points = back * seen.surface->points;
        result.surface->normals = back.linear() * seen.surface->normals;
    }
    if (seen.points) result.points->fixed = back * seen.points->fixed;
    if (seen.curves) {
        result.curves->fixed = back * seen.curves->fixed;
        result.curves->tangents = back.linear() * seen.curves->tangents;
    }
    return result;
}

void return_to_fixed_frame(UpdateResult& result, const Eigen::Isometry3d& start) {
    for (Eigen::Isometry3d* placement :
         {&result.deformation.placement, &result.alignment.placement, &result.pulls.placement})
        *placement = start * *placement;
    for (BodyMotion& body : result.bodies) body.motion = start * body.motion;
}

}  // namespace detail

}  // namespace tissuewarp::registration
