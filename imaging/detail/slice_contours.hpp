#pragma once
/// Outlines of a label in one slice.

#include "imaging/volume.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::imaging::detail {

/// Closed contours (3 × points, LPS mm, the first point not repeated) about the voxels of a label in slice k: they run
/// half way between voxels within and voxels without, so that a voxel's centre lies within an odd number of them when
/// it has the label. Voxels that touch at a corner alone are apart. `labels` is int32.
std::vector<Eigen::Matrix3Xd> slice_contours(const Volume& labels, int label, int k);

}  // namespace tissuewarp::imaging::detail
