#include "registration/matching/descriptors/matching_grid.hpp"

#include "core/errors.hpp"
#include "imaging/labels.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>

namespace tissuewarp::registration::detail {

using imaging::Geometry;
using imaging::Volume;

namespace {

/// The grid over the box [lower, upper], mm along the axes.
Geometry grid_over(const Eigen::Vector3d& lower, const Eigen::Vector3d& upper, const Eigen::Matrix3d& direction,
                   double spacing_mm) {
    Geometry grid;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<Eigen::Index>(axis);
        grid.size[axis] = std::max(2, static_cast<int>(std::ceil((upper[a] - lower[a]) / spacing_mm)) + 1);
    }
    grid.spacing.setConstant(spacing_mm);
    grid.direction = direction;
    grid.origin = direction * lower;
    return grid;
}

}  // namespace

void require_finite(const Volume& image, const char* name) {
    if (image.empty() || image.channels() != 1)
        throw InvalidInput(std::string(name) + " is empty or a field of vectors; give a scalar volume");
    const cv::Mat rows = image.voxels.reshape(1, image.geometry.size[2]);
    std::atomic<bool> finite = true;
    tbb::parallel_for(0, rows.rows, [&](int k) {
        if (!cv::checkRange(rows.row(k))) finite = false;
    });
    if (!finite)
        throw InvalidInput(std::string(name) + " has voxels that are not finite; replace them, or cut them off");
}

bool in_image(const Geometry& grid, const Eigen::Vector3d& point) {
    const Eigen::Array3d index = grid.index(point).array();
    const Eigen::Array3d last(grid.size[0] - 0.5, grid.size[1] - 0.5, grid.size[2] - 0.5);
    return (index >= -0.5).all() && (index <= last).all();
}

Geometry grid_about(const Eigen::Matrix3Xd& points, const Eigen::Matrix3d& direction, double spacing_mm,
                    double margin_mm) {
    const Eigen::Matrix3Xd along = direction.transpose() * points;
    return grid_over(along.rowwise().minCoeff().array() - margin_mm, along.rowwise().maxCoeff().array() + margin_mm,
                     direction, spacing_mm);
}

Geometry grid_about_mask(const Geometry& image, const Volume& mask, double margin_mm, double spacing_mm) {
    const auto boxes = imaging::label_statistics(imaging::mask_of_all(mask));
    if (boxes.empty()) throw InvalidInput("the mask is empty: there is no organ to find feature points in");
    const auto& box = boxes.begin()->second;
    Eigen::Matrix3Xd corners(3, 8);
    for (int c = 0; c < 8; ++c)
        corners.col(c) = mask.geometry.point({double(c & 1 ? box.upper[0] - 1 : box.lower[0]),
                                              double(c & 2 ? box.upper[1] - 1 : box.lower[1]),
                                              double(c & 4 ? box.upper[2] - 1 : box.lower[2])});
    const Eigen::Matrix3Xd along = image.direction.transpose() * corners;
    const Eigen::Vector3d first = image.direction.transpose() * image.origin;
    const Eigen::Vector3d extent =
        image.spacing.cwiseProduct(Eigen::Vector3d(image.size[0] - 1, image.size[1] - 1, image.size[2] - 1));
    const Eigen::Vector3d lower = (along.rowwise().minCoeff().array() - margin_mm).max(first.array());
    const Eigen::Vector3d upper = (along.rowwise().maxCoeff().array() + margin_mm).min((first + extent).array());
    if (!((upper - lower).minCoeff() > 0))
        throw InvalidInput("the mask does not lie on the image; check that both have the same place in the patient");
    return grid_over(lower, upper, image.direction, std::min(spacing_mm, image.spacing.minCoeff()));
}

}  // namespace tissuewarp::registration::detail
