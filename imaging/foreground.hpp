#pragma once
/// What stands out of the dark in a grey image: a body without a segmentation.

#include "imaging/volume.hpp"

namespace tissuewarp::imaging {

/// What a body must be like to be taken for one. Chosen by hand on a head, on balls in noise and on noise alone.
struct ForegroundOptions {
    double smoothing_mm = 1.0;     ///< standard deviation, against noise
    double most_of_image = 0.95;   ///< share of the voxels: beyond it nothing is background
    double least_of_image = 1e-4;  ///< below it nothing is there
    double least_of_bright = 0.5;  ///< share of the bright voxels that are one piece
    double most_of_voxels_outside =
        0.6;  ///< share of the body's voxels that touch the background: noise is all surface
};

struct Foreground {
    Volume labels;           ///< int32: 1 in the body, 0 elsewhere
    double threshold = 0;    ///< grey value above which, after smoothing, a voxel is bright
    double volume_mm3 = 0;   ///< of the body
    double image_share = 0;  ///< of the voxels, that are the body
};

/// The largest 6-connected piece brighter than the threshold of Otsu (IEEE Trans. SMC 1979), without its holes: dark
/// parts that the edge of the image is not reached from. Throws InvalidInput, with the number that says so, where the
/// image is constant, or nearly all, nearly nothing or no solid body of it is bright.
Foreground foreground(const Volume& image, const ForegroundOptions& options = {});

/// The mask (uint8 of 0 and 1) with every part of the background filled that does not reach the edge of the image.
Volume without_holes(const Volume& mask);

}  // namespace tissuewarp::imaging
