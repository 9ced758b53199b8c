#pragma once
/// How a rigid body moves along a curve.

#include "tled/effects.hpp"

#include <Eigen/Core>

namespace tissuewarp::simulation {

/// The body turns about a point, as that is at rest, and is then displaced: at a part s of the way its point X is at
/// point + R(s · turn) (X − point) + s · displacement.
struct RigidMotion {
    Eigen::Vector3d displacement = Eigen::Vector3d::Zero();  ///< mm
    Eigen::Vector3d turn = Eigen::Vector3d::Zero();          ///< along the axis, right-handed, rad
    Eigen::Vector3d point = Eigen::Vector3d::Zero();         ///< mm, on the axis at rest
};

/// How far the body's point X (mm, at rest) is from there at a part of the way, mm.
Eigen::Vector3d displacement_at(const RigidMotion& motion, double part, const Eigen::Vector3d& X);

/// Where the body is at a part of the way.
tled::RigidPlacement placement_at(const RigidMotion& motion, double part);

/// Velocity of its points there, where the part changes by `rate` (1/s).
tled::RigidVelocity velocity_at(const RigidMotion& motion, double part, double rate);

/// The most that a point of the body at most `reach` (mm) away from the axis goes for each unit of the part, mm.
double longest_way(const RigidMotion& motion, double reach);

/// How far a point of the body at rest is from the axis, mm; 0 without a turn.
double distance_from_axis(const RigidMotion& motion, const Eigen::Vector3d& X);

}  // namespace tissuewarp::simulation
