#pragma once
/// An image made ready for block matching: on an isotropic working grid, in the form that its similarity compares.

#include "imaging/volume.hpp"
#include "registration/image_matching.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace tissuewarp::registration::detail {

using Voxel = std::array<int, 3>;

constexpr int descriptor_channels = 12;

struct MatchingImage {
    imaging::Geometry grid;
    std::vector<std::uint8_t> descriptors;  ///< SelfSimilarityContext: 12 per voxel, 255 the most alike
    std::vector<float> values;              ///< CrossCorrelation: one per voxel, mean about 0
    std::vector<std::uint8_t> seen_run;     ///< voxels seen from this one on along i, at most 255; 0: not seen

    [[nodiscard]] std::int64_t offset(const Voxel& v) const {
        return v[0] + std::int64_t{grid.size[0]} * (v[1] + std::int64_t{grid.size[1]} * v[2]);
    }
};

/// Resamples `image` (float32, whose voxels `seen` != 0 count) on `grid`, smoothed by a Gaussian of 0.4 of
/// its spacing. Voxels whose descriptor reaches beyond what is seen are not seen.
MatchingImage matching_image(const imaging::Volume& image, const imaging::Volume& seen, const imaging::Geometry& grid,
                             Similarity similarity);

/// uint8 mask of what an image shows: 0 in and next to neighbourhoods of 3 × 3 × 3 voxels of one value, as padding
/// beyond a field of view leaves them.
imaging::Volume seen_region(const imaging::Volume& image);

/// The twelve channels of MIND-SSC (Heinrich et al. 2013), 12 bytes per voxel: exp(−D/V) of the patch distances D
/// between the six neighbours, two voxels away, that are not opposite to each other, less the smallest of them; V their
/// mean, bounded to 0.001 to 1000 times its mean over the image where it is seen. Patches are Gaussian windows.
std::vector<std::uint8_t> self_similarity_context(const imaging::Volume& image, const imaging::Volume& seen);

/// Voxels around one that its descriptor reads.
constexpr int descriptor_reach = 3;

}  // namespace tissuewarp::registration::detail
