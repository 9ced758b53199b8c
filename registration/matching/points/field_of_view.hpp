#pragma once
/// Where an image could have shown tissue.

#include "imaging/volume.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::registration::detail {

struct FieldOfViewOptions {
    int directions = 300;  ///< of half-spaces, beside a grid's axes. Chosen by hand; on which data is not recorded
};

/// The convex hull of what an image shows (its mask, uint8) from outside: the half-spaces of a few hundred directions.
/// Air beside the tissue lies in it when there is tissue around; padding beyond a plane does not.
class FieldOfView {
public:
    explicit FieldOfView(const imaging::Volume& seen);
    /// mm from a point (LPS) to the hull's furthest half-space: positive outside, negative inside.
    [[nodiscard]] double distance(const Eigen::Vector3d& point) const;
    /// Of points (3 × P), 1 where they lie in the hull, 0 elsewhere; in all threads.
    [[nodiscard]] std::vector<char> holds(const Eigen::Matrix3Xd& points) const;

private:
    Eigen::Matrix3Xd directions_;
    Eigen::VectorXd support_;  // max over the voxels shown of direction · point, mm
};

}  // namespace tissuewarp::registration::detail
