#pragma once
/// What a matching template holds.

#include "registration/matching/descriptors/matching_image.hpp"

namespace tissuewarp::registration::detail {

constexpr int refinement_reach = 3;  ///< voxels of the level, about the neighbours' story. By hand; data not recorded
constexpr int back_reach = 2;        ///< voxels about the block, of the way back: confidence ends at an error of two

/// Voxels about a point that a search of a given reach may look at: it walks on
/// a little from where it began.
constexpr int search_margin(int reach, int block_radius) {
    return reach + block_radius + 3;
}

struct TemplateImages {
    TemplateOptions options;
    Eigen::Matrix3Xd points;            ///< LPS mm
    imaging::Geometry image;            ///< the moving image's own grid
    std::vector<MatchingImage> levels;  ///< coarse to fine

    /// What of a level's grid is described.
    [[nodiscard]] SearchRegion region(const imaging::Geometry& grid) const {
        return {grid, points, search_margin(refinement_reach, options.block_radius)};
    }
};

}  // namespace tissuewarp::registration::detail
