#pragma once
/// Boxes cut out of a matching image, so that the inner loops meet neither the border of the grid nor memory far apart.

#include "registration/matching/blocks/squared_differences.hpp"
#include "registration/matching/descriptors/matching_image.hpp"

namespace tissuewarp::registration::detail {

/// Descriptors of a cube of voxels, up to `most_row_voxels` to a side, in memory that is used again. What is not seen,
/// or off the grid, is masked.
class BlockWindow {
public:
    void cut(const MatchingImage& image, const Voxel& lower, int side);

    /// Rows from the voxel (i, j, k) of the box on.
    [[nodiscard]] VoxelRows rows(const Voxel& from) const;

private:
    int side_ = 0;
    std::ptrdiff_t row_bytes_ = 0;
    std::size_t bytes_ = 0;  // of value and mask each, at least
    std::unique_ptr<std::uint8_t[]> value_, mask_;
    std::vector<RowKind> kind_;
    std::vector<std::uint64_t> seen_;

    void copy_row(const MatchingImage& image, const Voxel& lower, std::size_t row);
};

/// An image about a place. What lies near is cut out once, for many looks; image and window outlive this.
class Surroundings {
public:
    /// Of descriptors, the cube of ± reach voxels about `centre`, up to 31, is cut out at the first look.
    Surroundings(const MatchingImage& image, const Voxel& centre, int reach, BlockWindow& window)
        : image_(image), window_(window), centre_(centre), reach_(reach) {}

    [[nodiscard]] const MatchingImage& image() const { return image_; }
    /// Sees to it that the cube of ± reach voxels about a voxel of the image is cut out.
    void cover(const Voxel& centre, int reach);
    /// Rows from a voxel of the image on, which is covered.
    [[nodiscard]] VoxelRows rows(const Voxel& from) const;

private:
    const MatchingImage& image_;
    BlockWindow& window_;
    Voxel centre_;
    int reach_;
    bool cut_ = false;

    [[nodiscard]] Voxel lower() const { return {centre_[0] - reach_, centre_[1] - reach_, centre_[2] - reach_}; }
};

}  // namespace tissuewarp::registration::detail
