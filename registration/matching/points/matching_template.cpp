#include "core/errors.hpp"
#include "registration/matching/descriptors/matching_grid.hpp"
#include "registration/matching/points/template_images.hpp"

#include <cmath>
#include <string>

namespace tissuewarp::registration {

using imaging::Volume;

namespace {

void require_usable(const Volume& moving, const Eigen::Matrix3Xd& points, const TemplateOptions& options) {
    detail::require_finite(moving, "block matching: the moving image");
    if (!points.allFinite()) throw InvalidInput("block matching: a point is not finite; give LPS mm");
    const bool in_range = options.grid_spacing_mm > 0.05 && options.grid_spacing_mm < 50 && options.levels >= 1 &&
                          options.levels <= 8 && options.block_radius >= 1 && options.block_radius <= 10;
    if (!in_range)
        throw InvalidInput(
            "block matching: template options out of range; grid spacing 0.05 to 50 mm, 1 to 8 levels, block radius 1 "
            "to 10 voxels");
}

/// The points that lie in the image.
Eigen::Matrix3Xd in_image(const imaging::Geometry& image, const Eigen::Matrix3Xd& points) {
    std::vector<Eigen::Index> usable;
    for (Eigen::Index n = 0; n < points.cols(); ++n)
        if (detail::in_image(image, points.col(n))) usable.push_back(n);
    if (usable.empty())
        throw InvalidInput("block matching: none of " + std::to_string(points.cols()) +
                           " points lies in the moving image; give LPS mm of its frame");
    return points(Eigen::all, usable);
}

}  // namespace

MatchingTemplate::MatchingTemplate(const Volume& moving, const Eigen::Matrix3Xd& points,
                                   const TemplateOptions& options) {
    require_usable(moving, points, options);
    const Eigen::Matrix3Xd usable = in_image(moving.geometry, points);
    const Volume image = moving.as(CV_32F), seen = detail::seen_region(image);
    auto images = std::make_shared<detail::TemplateImages>();
    images->options = options;
    images->points = points;
    images->image = moving.geometry;
    for (int level = 0; level < options.levels; ++level) {
        const double spacing = options.grid_spacing_mm * std::pow(2, options.levels - 1 - level);
        const int margin = detail::search_margin(detail::refinement_reach, options.block_radius);
        const imaging::Geometry grid = detail::grid_about(usable, moving.geometry.direction, spacing, margin * spacing);
        images->levels.push_back(detail::matching_image(image, seen, grid, images->region(grid)));
    }
    images_ = std::move(images);
}

const Eigen::Matrix3Xd& MatchingTemplate::points() const {
    return images_->points;
}

const TemplateOptions& MatchingTemplate::options() const {
    return images_->options;
}

}  // namespace tissuewarp::registration
