#include "imaging/volume.hpp"

#include "core/errors.hpp"

#include <tbb/parallel_for.h>

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
    if (empty()) return {geometry, cv::Mat()};
    cv::Mat converted(3, voxels.size.p, CV_MAKETYPE(cv_depth, voxels.channels()));
    const cv::Mat from = voxels.reshape(0, voxels.size[0]);
    const cv::Mat to = converted.reshape(0, voxels.size[0]);
    tbb::parallel_for(0, from.rows, [&](int k) {
        cv::Mat row = to.row(k);
        from.row(k).convertTo(row, cv_depth);
    });
    return {geometry, std::move(converted)};
}

}  // namespace tissuewarp::imaging
