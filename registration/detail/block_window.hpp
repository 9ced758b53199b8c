#pragma once
/// A box cut out of a matching image, so that the inner loops meet neither the border of the grid nor memory far apart.

#include "registration/detail/matching_image.hpp"
#include "registration/detail/squared_differences.hpp"

namespace tissuewarp::registration::detail {

/// Descriptors of a box of voxels. What is not seen, or off the grid, is masked.
class BlockWindow {
public:
    BlockWindow(const MatchingImage& image, const Voxel& lower, int side);

    [[nodiscard]] bool whole() const { return whole_; }  ///< every voxel is seen
    /// Rows from the voxel (0, j, k) of the box on.
    [[nodiscard]] ByteRows rows(int j, int k) const;

private:
    int side_;
    bool whole_ = true;
    std::vector<std::uint8_t> value_, mask_;

    void copy_row(const MatchingImage& image, const Voxel& lower, std::size_t target);
};

}  // namespace tissuewarp::registration::detail
