#pragma once
/// Does an image show speckle, as ultrasound does?

#include "registration/matching/descriptors/matching_image.hpp"

namespace tissuewarp::registration::detail {

/// Chosen on `ultrasound:1-12` and the images of data/: noise and bare skulls look so, too. How much more than the
/// moving image: on 741 to 776 of the three families of `study coverage` and 2101 to 2130 of both of ultrasound
/// (docs/decisions/ultrasound.md).
struct SpeckleOptions {
    double least_speckle = 0.1;      ///< see speckle_of
    double least_over_moving = 1.5;  ///< times what the moving image has: noise of a scanner is in both
    double most_seen = 0.95;         ///< of the grid: a fan leaves corners
    double step_mm = 0.8;            ///< from one voxel of a patch to the next, or the least above: that of the seeds
};

/// Median over places of the deviation from a plane in 27 voxels about them, over their mean above the darkest percent:
/// 0.2 to 0.4 in ultrasound, a few hundredths in images of tissue without noise. Voxels finer than a grain of speckle
/// are passed over: beside each other they are alike.
double speckle_of(const SeenImage& image, const SpeckleOptions& options = {});

/// Speckle, in a part of the grid.
bool is_speckled(const SeenImage& image, const SpeckleOptions& options = {});

/// Speckle that the moving image does not have.
bool has_more_speckle(const SeenImage& fixed, const SeenImage& moving, const SpeckleOptions& options = {});

}  // namespace tissuewarp::registration::detail
