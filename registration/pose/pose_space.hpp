#pragma once
/// Motions of numbers that searches can vary.

#include <Eigen/Geometry>

#include <cmath>

namespace tissuewarp::registration::detail {

/// Similarity from seven numbers, all in mm: translation, rotation vector about `centre` times `radius`, and logarithm
/// of the scale times `radius`.
struct PoseSpace {
    Eigen::Vector3d centre;
    double radius = 1;

    /// Of the first six.
    [[nodiscard]] Eigen::Isometry3d rigid(const double* x) const {
        const Eigen::Vector3d rotation = Eigen::Vector3d(x[3], x[4], x[5]) / radius;
        const double angle = rotation.norm();
        Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
        if (angle > 0) result.linear() = Eigen::AngleAxisd(angle, rotation / angle).toRotationMatrix();
        result.translation() = centre + Eigen::Vector3d(x[0], x[1], x[2]) - result.linear() * centre;
        return result;
    }
    [[nodiscard]] Eigen::Affine3d similarity(const double* x) const {
        const Eigen::Affine3d grown =
            Eigen::Translation3d(centre) * Eigen::Scaling(std::exp(x[6] / radius)) * Eigen::Translation3d(-centre);
        return rigid(x) * grown;
    }
};

}  // namespace tissuewarp::registration::detail
