#pragma once
/// Where an image of the operation has no structure and the preoperative one, carried along, has some.

#include "imaging/volume.hpp"
#include "registration/resection/find_resection.hpp"
#include "registration/resection/without_structure.hpp"

namespace tissuewarp::registration::detail {

/// uint8: voxels of the organ without structure where the tissue that lies there shows some, or is of a grey that goes
/// with another one elsewhere. `moving`: the preoperative image on the grid of the view, likewise; its organ does not
/// count.
imaging::Volume without_counterpart(const CavityView& fixed, const CavityView& moving);

}  // namespace tissuewarp::registration::detail
