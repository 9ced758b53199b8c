#include "imaging/volume.hpp"

#include "core/errors.hpp"

#include <string>
#include <utility>

namespace tissuewarp::imaging {

Volume::Volume(const Geometry& grid, int cv_type) : geometry(grid) {
    require_valid(grid, "volume");
    const int sizes[3] = {grid.size[2], grid.size[1], grid.size[0]};
    voxels = cv::Mat::zeros(3, sizes, cv_type);
}

Volume::Volume(const Geometry& grid, cv::Mat data) : geometry(grid), voxels(std::move(data)) {
    require_valid(grid, "volume");
    if (voxels.dims != 3 || !voxels.isContinuous())
        throw InvalidInput("volume: the matrix has " + std::to_string(voxels.dims) +
                           " dimensions or gaps in memory; give a continuous one of 3 dimensions");
    for (int axis = 0; axis < 3; ++axis)
        if (voxels.size[axis] != grid.size[2 - axis])
            throw InvalidInput("volume: the matrix has " + std::to_string(voxels.size[axis]) +
                               " voxels along dimension " + std::to_string(axis) + ", the geometry " +
                               std::to_string(grid.size[2 - axis]) + "; sizes are ordered slice, row, column");
}

Volume Volume::as(int cv_depth) const {
    if (voxels.depth() == cv_depth) return *this;
    cv::Mat converted;
    voxels.convertTo(converted, cv_depth);
    return {geometry, std::move(converted)};
}

}  // namespace tissuewarp::imaging
