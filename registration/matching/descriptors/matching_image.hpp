#pragma once
/// An image made ready for block matching: descriptors on an isotropic working grid.

#include "registration/matching/descriptors/self_similarity.hpp"
#include "registration/matching/image_matching.hpp"

#include <functional>

namespace tissuewarp::registration::detail {

using Voxel = std::array<int, 3>;

struct MatchingImage {
    imaging::Geometry grid;
    std::unique_ptr<std::uint8_t[]> descriptors;  ///< of self-similarity: 12 per voxel, 255 the most alike
    std::vector<std::uint8_t> seen;               ///< 1 where a voxel counts; 0 off the region that was asked for

    [[nodiscard]] std::int64_t offset(const Voxel& v) const {
        return v[0] + std::int64_t{grid.size[0]} * (v[1] + std::int64_t{grid.size[1]} * v[2]);
    }
};

/// Samples `image` (float32, whose voxels `seen` != 0 count) in a region of `grid`, smoothed for
/// it. Voxels whose descriptor reaches beyond what is seen are not seen.
MatchingImage matching_image(const imaging::Volume& image, const imaging::Volume& seen, const imaging::Geometry& grid,
                             const SearchRegion& region);

struct WorkingImageOptions {
    double smoothing_spacings = 0.4;  ///< standard deviation. Chosen by hand; on which data is not recorded
};

/// Standard deviation (mm) of the Gaussian that smooths an image for a working grid.
constexpr double working_deviation(double spacing_mm) {
    return WorkingImageOptions().smoothing_spacings * spacing_mm;
}

/// An image so smoothed.
imaging::Volume smoothed_for(const imaging::Volume& image, const imaging::Geometry& grid);

/// Descriptors of self-similarity of the image that has at each voxel of `grid` what `image` shows where a deformation
/// takes that voxel: `displacement` (three channels float32, LPS mm) lies on GridSamples::with_rim(grid).
MatchingImage pulled_back_image(const imaging::Volume& image, const imaging::Volume& seen,
                                const imaging::Geometry& grid, const SearchRegion& region,
                                const imaging::Volume& displacement);

/// Kept from one image to the next: fresh memory costs more than what is computed in it.
struct SeenMemory {
    cv::Mat image, seen;
    std::vector<std::uint8_t> one, other;
};

/// uint8 mask of what an image (float32) shows: 0 in and next to neighbourhoods of 3 × 3 × 3 voxels of one value, as
/// padding beyond a field of view leaves them.
imaging::Volume seen_region(const imaging::Volume& image);
imaging::Volume seen_region(const imaging::Volume& image, SeenMemory& memory);

/// An image as float32, and what it shows: made once, looked at by all that search in it.
struct SeenImage {
    imaging::Volume image, seen;
    /// Throws InvalidInput where the image is empty, a field of vectors or not finite.
    explicit SeenImage(const imaging::Volume& given);
    /// Serves until another one is made in the same memory. `converted` gets the image before what it shows is found.
    SeenImage(
        const imaging::Volume& given, SeenMemory& memory,
        const std::function<void(const imaging::Volume&)>& converted = [](const imaging::Volume&) {});
};

}  // namespace tissuewarp::registration::detail
