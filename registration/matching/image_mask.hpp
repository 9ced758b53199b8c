#pragma once
/// Parts of an image that must not be matched: instruments, lesions, artefacts.

#include "imaging/volume.hpp"

namespace tissuewarp::registration {

/// The image (float32) showing nothing where `mask` is 0, or off the mask's grid, for prepare_image() and
/// Intraoperative::image: no block and no dense force looks there. Voxels next to those, by one of the image's, go with
/// them. Nonzero means "may be matched", as in elastix and ANTs; the mask may lie on any grid. What the image shows
/// about such a part still tells how far the field of view reaches. Throws InvalidInput where nothing is left.
imaging::Volume without_unmatched(const imaging::Volume& image, const imaging::Volume& mask);

}  // namespace tissuewarp::registration
