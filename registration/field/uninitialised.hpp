#pragma once
/// Volumes that are about to be written in full.

#include "imaging/volume.hpp"

namespace tissuewarp::registration::detail {

/// Voxels of any content. Zeroing 200 MB costs more than computing some fields does, and on one thread.
inline imaging::Volume uninitialised(const imaging::Geometry& grid, int cv_type) {
    imaging::require_valid(grid, "volume");
    const int sizes[3] = {grid.size[2], grid.size[1], grid.size[0]};
    return {grid, cv::Mat(3, sizes, cv_type)};
}

}  // namespace tissuewarp::registration::detail
