#include "simulation/rigid_motion.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::simulation {

using Eigen::Vector3d;

namespace {

/// Precondition: the motion turns.
Eigen::Matrix3d rotation_at(const RigidMotion& motion, double part) {
    const double angle = motion.turn.norm();
    return Eigen::AngleAxisd(part * angle, motion.turn / angle).toRotationMatrix();
}

}  // namespace

Vector3d displacement_at(const RigidMotion& motion, double part, const Vector3d& X) {
    const Vector3d shift = part * motion.displacement;
    if (!(motion.turn.norm() > 0)) return shift;
    const Vector3d arm = X - motion.point;
    return shift + rotation_at(motion, part) * arm - arm;
}

tled::RigidPlacement placement_at(const RigidMotion& motion, double part) {
    tled::RigidPlacement placement;
    placement.shift = part * motion.displacement;
    if (!(motion.turn.norm() > 0)) return placement;
    placement.rotation = rotation_at(motion, part);
    placement.shift += motion.point - placement.rotation * motion.point;
    return placement;
}

tled::RigidVelocity velocity_at(const RigidMotion& motion, double part, double rate) {
    const Vector3d spin = rate * motion.turn, point = motion.point + part * motion.displacement;
    return {rate * motion.displacement - spin.cross(point), spin};
}

double longest_way(const RigidMotion& motion, double reach) {
    return motion.displacement.norm() + reach * motion.turn.norm();
}

double distance_from_axis(const RigidMotion& motion, const Vector3d& X) {
    const double angle = motion.turn.norm();
    return angle > 0 ? (X - motion.point).cross(motion.turn / angle).norm() : 0.0;
}

}  // namespace tissuewarp::simulation
