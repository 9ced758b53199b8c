#pragma once
/// Loops over the voxels of a grid with their places.

#include "imaging/geometry.hpp"

#include <tbb/parallel_for.h>

#include <cstdint>

namespace tissuewarp::imaging {

/// visit(X, n) for every voxel, n its offset in memory and X its centre (LPS mm), in the order of memory.
template <class Visit>
void for_each_place_in_order(const Geometry& grid, const Visit& visit) {
    std::int64_t n = 0;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) visit(grid.point(Eigen::Vector3d(i, j, k)), n++);
}

/// The same, slices in parallel.
template <class Visit>
void for_each_place(const Geometry& grid, const Visit& visit) {
    const std::int64_t slice = std::int64_t{grid.size[0]} * grid.size[1];
    tbb::parallel_for(0, grid.size[2], [&](int k) {
        std::int64_t n = k * slice;
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) visit(grid.point(Eigen::Vector3d(i, j, k)), n++);
    });
}

}  // namespace tissuewarp::imaging
