#pragma once
/// Where an image of the operation has no structure and the preoperative one, carried along, has some.

#include "imaging/volume.hpp"
#include "registration/resection/without_structure.hpp"

namespace tissuewarp::registration::detail {

/// Whether so much of the organ has no structure that it may hold a cavity: what follows takes longer.
bool may_hold_cavity(const CavityView& fixed);

/// uint8: voxels of the organ without structure where the tissue that lies there shows some, or is of a grey that goes
/// with another one elsewhere (CavityOptions). `moving`: the preoperative image on the grid of the view, smoothed
/// against noise, float32.
imaging::Volume without_counterpart(const CavityView& fixed, const imaging::Volume& moving);

}  // namespace tissuewarp::registration::detail
