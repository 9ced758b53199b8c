#include "registration/matching/descriptors/matching_image.hpp"

#include "imaging/filters.hpp"

#include <algorithm>

namespace tissuewarp::registration::detail {

using imaging::Volume;

namespace {

/// The part of an image within `border` of a grid; the image itself when they do not meet.
struct Cut {
    Volume image, seen;

    Cut(const Volume& from, const Volume& from_seen, const imaging::Geometry& grid, double border_mm) {
        Eigen::Vector3d lower = Eigen::Vector3d::Constant(1e9), upper = -lower;
        for (int c = 0; c < 8; ++c) {
            const Eigen::Vector3d corner((c & 1) * grid.size[0], (c / 2 & 1) * grid.size[1], (c / 4) * grid.size[2]);
            const Eigen::Vector3d index = from.geometry.index(grid.point(corner));
            lower = lower.cwiseMin(index);
            upper = upper.cwiseMax(index);
        }
        std::array<int, 3> first, last;
        bool meets = true;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const auto a = static_cast<Eigen::Index>(axis);
            const double wide = border_mm / from.geometry.spacing[a] + 1, size = from.geometry.size[axis];
            first[axis] = static_cast<int>(std::clamp(lower[a] - wide, 0.0, size));
            last[axis] = static_cast<int>(std::clamp(upper[a] + wide + 1, 0.0, size));
            meets = meets && first[axis] < last[axis];
        }
        image = meets ? imaging::crop(from, first, last) : from;
        seen = meets ? imaging::crop(from_seen, first, last) : from_seen;
    }
};

MatchingImage described(const GridSamples& samples, const imaging::Geometry& grid, const SearchRegion& region) {
    Descriptors descriptors = self_similarity_context(samples, grid, region);
    return {grid, std::move(descriptors.channels), std::move(descriptors.seen)};
}

}  // namespace

MatchingImage matching_image(const Volume& image, const Volume& seen, const imaging::Geometry& grid,
                             const SearchRegion& region) {
    const double sigma = working_deviation(grid.spacing[0]);
    const Cut cut(image, seen, grid, GridSamples::rim * grid.spacing[0] + 4 * sigma);
    return described(GridSamples(imaging::smooth(cut.image, sigma), cut.seen, grid, region), grid, region);
}

Volume smoothed_for(const Volume& image, const imaging::Geometry& grid) {
    return imaging::smooth(image, working_deviation(grid.spacing[0]));
}

MatchingImage pulled_back_image(const Volume& image, const Volume& seen, const imaging::Geometry& grid,
                                const SearchRegion& region, const Volume& displacement) {
    return described(GridSamples(smoothed_for(image, grid), seen, grid, region, displacement), grid, region);
}

}  // namespace tissuewarp::registration::detail
