#pragma once
/// Carrying images, labels and meshes from the preoperative to the intraoperative frame.

#include "imaging/volume.hpp"
#include "registration/deformation.hpp"

namespace tissuewarp::registration {

/// Pulls the moving image through `fixed_to_moving` (a field on the wanted grid), trilinear; keeps the voxel type.
/// Voxels whose tissue lay outside the moving image become `outside`.
imaging::Volume warp_image(const imaging::Volume& moving, const imaging::Volume& fixed_to_moving, double outside = 0.0);

/// The same of a deformation at once, for images that follow each other: in the mesh as through
/// displacement_fixed_to_moving(), outside as the placement alone has it, with a step at the organ's surface; what
/// GpuWarp gives without a continuation. A fraction of the time. Throws InvalidInput.
imaging::Volume warp_by_mesh(const imaging::Volume& moving, const Deformation& deformation,
                             const imaging::Geometry& fixed_grid, double outside = 0.0);

/// warp_image() for labels, nearest neighbour: no label is invented.
imaging::Volume warp_labels(const imaging::Volume& moving_labels, const imaging::Volume& fixed_to_moving);

}  // namespace tissuewarp::registration
