#pragma once
/// A volume from the frames of a sweep.

#include "core/observer.hpp"
#include "imaging/sweep.hpp"

namespace tissuewarp::imaging {

struct CompoundingOptions {
    double spacing_mm = 0.5;      ///< of the volume's voxels
    double largest_gap_mm = 3.0;  ///< between frames that follow each other; in a wider one nothing is shown
};

struct Compounded {
    Volume volume;              ///< type of the pixels; 0 where nothing was seen, at least 1 where something was
    double seen_share = 0;      ///< of its voxels
    double median_step_mm = 0;  ///< from frame to frame, across them at their middle
    int gaps = 0;               ///< between frames, wider than the largest
};

/// Each voxel is a weighted mean of the frames about it, bilinear in their planes: between two frames that follow each
/// other a linear interpolation, and about each frame, within a voxel, those beside it too. Pixels whose value hardly
/// ever changes are the scanner's picture about the fan and are left out. The axes are those of LPS. Throws
/// InvalidInput where frames span no volume, or one of more than 2²⁹ voxels.
Compounded compound(const Sweep& sweep, const CompoundingOptions& options = {}, Observer& observer = silent_observer());

}  // namespace tissuewarp::imaging
