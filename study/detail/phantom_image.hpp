#pragma once
/// Grey values of a random organ, before and after it moved.

#include "imaging/volume.hpp"
#include "study/detail/random.hpp"
#include "study/detail/true_tissue.hpp"
#include "study/phantom.hpp"

namespace tissuewarp::study::detail {

/// Tissue, its inclusion and its surroundings each have a grey level and structure of 3 to 24 mm, and vessels run
/// through them. All of it follows the tissue, and rigidly what is around it. Voxels of 1.5 mm.
PhantomImages drawn_images(const TrueTissue& tissue, Random& random);

}  // namespace tissuewarp::study::detail
