#pragma once
/// Grids as DICOM has them: the third axis is the cross product of the other two.

#include "imaging/volume.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::imaging::detail {

/// The same voxels in the same places, slices in the other order where the axes are left-handed.
inline Volume right_handed(const Volume& volume) {
    const Geometry& grid = volume.geometry;
    if (grid.direction.determinant() > 0) return volume;
    const int slices = grid.size[2];
    Volume turned(grid, volume.voxels.type());
    turned.geometry.origin = grid.point({0, 0, double(slices - 1)});
    turned.geometry.direction.col(2) *= -1;
    const cv::Mat from = volume.voxels.reshape(1, slices);
    cv::Mat to = turned.voxels.reshape(1, slices);
    for (int k = 0; k < slices; ++k) from.row(k).copyTo(to.row(slices - 1 - k));
    return turned;
}

}  // namespace tissuewarp::imaging::detail
