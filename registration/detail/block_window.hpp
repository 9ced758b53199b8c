#pragma once
/// A box cut out of a matching image, so that the inner loops meet neither the border of the grid nor memory far apart.

#include "registration/detail/matching_image.hpp"
#include "registration/detail/squared_differences.hpp"

namespace tissuewarp::registration::detail {

/// Descriptors of a cube of voxels, up to `most_row_voxels` to a side. What is not seen, or off the grid, is masked.
class BlockWindow {
public:
    BlockWindow(const MatchingImage& image, const Voxel& lower, int side);

    /// Rows from the voxel (i, j, k) of the box on.
    [[nodiscard]] VoxelRows rows(const Voxel& from) const;

private:
    int side_;
    std::ptrdiff_t row_bytes_;
    std::unique_ptr<std::uint8_t[]> value_, mask_;
    std::vector<RowKind> kind_;
    std::vector<std::uint64_t> seen_;

    void copy_row(const MatchingImage& image, const Voxel& lower, std::size_t row);
};

}  // namespace tissuewarp::registration::detail
