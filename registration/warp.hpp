#pragma once
/// Carrying images, labels and meshes from the preoperative to the intraoperative frame.

#include "imaging/volume.hpp"
#include "registration/deformation.hpp"

namespace tissuewarp::registration {

/// Pulls the moving image through `fixed_to_moving` (a field on the wanted grid), trilinear; keeps the voxel type.
/// Voxels whose tissue lay outside the moving image become `outside`.
imaging::Volume warp_image(const imaging::Volume& moving, const imaging::Volume& fixed_to_moving, double outside = 0.0);

/// The same for labels, nearest neighbour: no label is invented.
imaging::Volume warp_labels(const imaging::Volume& moving_labels, const imaging::Volume& fixed_to_moving);

}  // namespace tissuewarp::registration
