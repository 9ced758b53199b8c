#pragma once
/// MIND-SSC descriptors (Heinrich et al. 2013).

#include "registration/matching/descriptors/grid_samples.hpp"

namespace tissuewarp::registration::detail {

constexpr int descriptor_channels = 12;

/// Voxels around one that its descriptor reads.
constexpr int descriptor_extent = 8;

/// And those that must be seen for it to count: the rest weighs little. Chosen by hand; on which data is not recorded.
constexpr int descriptor_reach = 3;

/// Bounds of V, over its mean where the image is seen. Chosen by hand; on which data is not recorded.
struct SelfSimilarityOptions {
    double least_variance = 1e-3, most_variance = 1e3;
};

struct Descriptors {
    std::unique_ptr<std::uint8_t[]>
        channels;                    ///< 12 per voxel of the grid, 255 the most alike; any content off the region
    std::vector<std::uint8_t> seen;  ///< 1 where the descriptor counts
};

/// Twelve channels for each voxel of the region: exp(−D/V) of the patch distances D between the six neighbours, two
/// voxels away, that are not opposite to each other, less the smallest of them; V their mean, bounded to 0.001 to 1000
/// times the mean squared difference of such neighbours where the image is seen. Patches are Gaussian windows of one
/// voxel. In eight bits.
Descriptors self_similarity_context(const GridSamples& samples, const imaging::Geometry& grid,
                                    const SearchRegion& region);

}  // namespace tissuewarp::registration::detail
