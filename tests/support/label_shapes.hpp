#pragma once
/// Label volumes of simple organs: an ellipsoid with a ball in it.

#include "imaging/volume.hpp"

#include <Eigen/Geometry>

#include <array>

namespace tissuewarp::shapes {

struct Organ {
    Eigen::Vector3d centre{0, 0, 0};        ///< LPS mm
    Eigen::Vector3d semi_axes{45, 35, 30};  ///< mm
    Eigen::Vector3d inclusion{12, 5, 4};    ///< centre of the ball, mm from the organ's centre
    double inclusion_radius = 9;            ///< mm
};

/// Labels 1 (organ) and 2 (ball) of the organ after a rigid motion, on a grid of `spacing` mm around the origin.
inline imaging::Volume organ_labels(const Organ& organ, const Eigen::Isometry3d& motion = Eigen::Isometry3d::Identity(),
                                    double spacing = 1.5,
                                    const Eigen::Matrix3d& direction = Eigen::Matrix3d::Identity()) {
    imaging::Geometry grid;
    const int count = static_cast<int>(130 / spacing);
    grid.size = {count, count, count};
    grid.spacing.setConstant(spacing);
    grid.direction = direction;
    grid.origin = -direction * Eigen::Vector3d::Constant(0.5 * spacing * (count - 1));
    imaging::Volume labels(grid, CV_32SC1);
    const Eigen::Isometry3d back = motion.inverse();
    for (int k = 0; k < count; ++k)
        for (int j = 0; j < count; ++j)
            for (int i = 0; i < count; ++i) {
                const Eigen::Vector3d x = back * grid.point({double(i), double(j), double(k)}) - organ.centre;
                const bool inside = x.cwiseQuotient(organ.semi_axes).squaredNorm() <= 1;
                const bool ball = (x - organ.inclusion).norm() <= organ.inclusion_radius;
                labels.data<std::int32_t>()[labels.offset(i, j, k)] = inside ? (ball ? 2 : 1) : 0;
            }
    return labels;
}

inline Eigen::Isometry3d motion(double angle_deg, const Eigen::Vector3d& axis, const Eigen::Vector3d& translation) {
    Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
    result.linear() = Eigen::AngleAxisd(angle_deg * EIGEN_PI / 180, axis.normalized()).toRotationMatrix();
    result.translation() = translation;
    return result;
}

}  // namespace tissuewarp::shapes
