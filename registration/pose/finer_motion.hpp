#pragma once
/// The rigid motion of a body, finer than faces between voxels tell.

#include "imaging/volume.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::registration::detail {

/// Chosen by hand.
struct FinerMotionOptions {
    double first_scale_mm = 6;   ///< distances that differ by more weigh little: another shape, a wrong label …
    double falling = 0.6;        ///< … less from step to step …
    double last_scale_mm = 1;    ///< … down to this
    int samples = 3000;          ///< boundary points of each map
    int most_steps = 20;         ///< of Gauss and Newton
    double tolerance_mm = 1e-3;  ///< of a step, over the body
    double stiffness = 1e-3;     ///< that holds what the boundaries do not tell, over what they tell best
};

/// Of a label: its boundary points in one map, and the signed distance to them (mm, float32, smoothed) on a grid about
/// them.
struct BodyBoundary {
    const Eigen::Matrix3Xd& points;
    const imaging::Volume& distance;
};

/// Least squares of the differences of both signed distances, at the boundary points of either map, from a motion
/// (moving → fixed) that is a voxel or two off. At its own boundary a distance is not 0 but what voxels leave of it,
/// which the difference takes away.
Eigen::Isometry3d finer_motion(const BodyBoundary& moving, const BodyBoundary& fixed, const Eigen::Isometry3d& start,
                               const FinerMotionOptions& options = {});

}  // namespace tissuewarp::registration::detail
