#pragma once
/// Where an organ lies before anything is matched, when something other than the headers says so.

#include "registration/intraoperative.hpp"
#include "registration/io/point_map.hpp"
#include "registration/result.hpp"

namespace tissuewarp::registration {

/// The rigid motion that comes closest to a transform where the organ is.
struct StartPose {
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed
    double deformation_mm = 0;  ///< root mean square of what of the transform is not rigid
    double furthest_mm = 0;     ///< the most of it
};

/// Least squares over places of the labelled tissue (voxels != 0, moving frame): of all of the organ for a linear map,
/// of what the grid of a displacement field reaches for one with a field. Throws InvalidInput where a linear map
/// mirrors or flattens, and where a field finds the organ at fewer than ten places.
StartPose start_pose(const PointMap& map, const imaging::Volume& organ);

namespace detail {

/// What was seen as it would be, were the headers to place the organ by `start`: everything is turned back by it.
Intraoperative seen_from(const Intraoperative& seen, const Eigen::Isometry3d& start);

/// A result of that, in the frame of what was seen.
void return_to_fixed_frame(UpdateResult& result, const Eigen::Isometry3d& start);

}  // namespace detail

}  // namespace tissuewarp::registration
