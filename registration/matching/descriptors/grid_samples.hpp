#pragma once
/// An image on a working grid, with a rim, so that filters need not mind the border.

#include "registration/matching/blocks/search_region.hpp"

#include <cstdint>
#include <memory>

namespace tissuewarp::registration::detail {

class GridSamples {
public:
    static constexpr int rim = 8;  ///< voxels about the grid

    /// Linear values of `image` (float32) and nearest ones of `seen` (uint8; both on one grid) at the voxels of the
    /// region and within `rim` of it. Off the image both are 0; elsewhere they have any content.
    GridSamples(const imaging::Volume& image, const imaging::Volume& seen, const imaging::Geometry& grid,
                const SearchRegion& region);

    /// The same at voxels moved by `displacement` (three channels float32, LPS mm), a field on the grid with its rim.
    GridSamples(const imaging::Volume& image, const imaging::Volume& seen, const imaging::Geometry& grid,
                const SearchRegion& region, const imaging::Volume& displacement);

    /// The grid and its rim.
    static imaging::Geometry with_rim(const imaging::Geometry& grid);

    /// The voxel (i, j, k) of the grid, −rim ≤ i < size + rim.
    [[nodiscard]] const float* value(int i, int j, int k) const { return value_.get() + offset(i, j, k); }
    [[nodiscard]] const std::uint8_t* seen(int i, int j, int k) const { return seen_.get() + offset(i, j, k); }
    [[nodiscard]] std::ptrdiff_t offset(int i, int j, int k) const {
        return i + rim + size_[0] * (j + rim + std::ptrdiff_t{size_[1]} * (k + rim));
    }

private:
    std::array<int, 3> size_;  // rim included
    std::unique_ptr<float[]> value_;
    std::unique_ptr<std::uint8_t[]> seen_;

    explicit GridSamples(const imaging::Geometry& grid);
};

}  // namespace tissuewarp::registration::detail
