#pragma once
/// Where tissue parted.

#include "imaging/volume.hpp"
#include "registration/deformation.hpp"

namespace tissuewarp::registration {

/// A place that holds more than so many times what the preoperative image shows there was not filled by it.
constexpr double most_stretch_of_volume = 2;

/// uint8 on the grid of `fixed_to_moving`, a field of the deformation: 1 in voxels beside the organ and rigid
/// surroundings that show what lay between them stretched to more than twice its volume, 0 elsewhere. Fluid or air has
/// come there, of which the preoperative image knows nothing. Throws InvalidInput unless the field has three channels
/// of float32.
imaging::Volume parted_after(const Deformation& deformation, const imaging::Volume& fixed_to_moving);

}  // namespace tissuewarp::registration
