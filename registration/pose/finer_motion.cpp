#include "registration/pose/finer_motion.hpp"

#include "imaging/sampling.hpp"
#include "registration/pose/label_boundaries.hpp"
#include "registration/pose/pose_space.hpp"
#include "registration/pose/robust_weight.hpp"

#include <Eigen/Dense>

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// How a distance with this gradient changes at a place (fixed frame) with the first six numbers of the space.
Vector6d derivative(const PoseSpace& space, const Vector3d& place, const Vector3d& gradient) {
    Vector6d result;
    result << gradient, (place - space.centre).cross(gradient) / space.radius;
    return result;
}

struct NormalEquations {
    Eigen::Matrix<double, 6, 6> matrix = Eigen::Matrix<double, 6, 6>::Zero();
    Vector6d right = Vector6d::Zero();

    void add(const Vector6d& derivative, double residual, double scale_mm) {
        const double weight = robust_weight(residual, scale_mm);
        matrix += weight * derivative * derivative.transpose();
        right -= weight * residual * derivative;
    }
    [[nodiscard]] Vector6d step(double stiffness) const {
        Eigen::Matrix<double, 6, 6> held = matrix;
        held.diagonal().array() += stiffness * matrix.diagonal().maxCoeff();
        return held.ldlt().solve(right);
    }
};

}  // namespace

Isometry3d finer_motion(const BodyBoundary& moving, const BodyBoundary& fixed, const Isometry3d& start,
                        const FinerMotionOptions& options) {
    const imaging::LinearSampler in_moving(moving.distance), in_fixed(fixed.distance);
    const Eigen::Matrix3Xd from = thinned(moving.points, options.samples), to = thinned(fixed.points, options.samples);
    const Vector3d centre = to.rowwise().mean();
    const PoseSpace space{centre, std::max(1.0, std::sqrt((to.colwise() - centre).colwise().squaredNorm().mean()))};
    Isometry3d motion = start;
    double scale_mm = options.first_scale_mm;
    for (int step = 0; step < options.most_steps; ++step) {
        NormalEquations equations;
        for (const auto& x : from.colwise()) {
            const Vector3d y = motion * x;
            const auto [distance, gradient] = in_fixed.value_and_gradient(y);
            equations.add(derivative(space, y, gradient), distance - in_moving.value(x), scale_mm);
        }
        const Isometry3d back = motion.inverse();
        for (const auto& y : to.colwise()) {
            const auto [distance, gradient] = in_moving.value_and_gradient(back * y);
            equations.add(-derivative(space, y, motion.linear() * gradient), distance - in_fixed.value(y), scale_mm);
        }
        const Vector6d change = equations.step(options.stiffness);
        motion = space.rigid(change.data()) * motion;
        if (scale_mm <= options.last_scale_mm && change.norm() < options.tolerance_mm) break;
        scale_mm = std::max(options.last_scale_mm, options.falling * scale_mm);
    }
    return motion;
}

}  // namespace tissuewarp::registration::detail
