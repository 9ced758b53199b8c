#include "core/errors.hpp"
#include "imaging/detail/distance_transform.hpp"
#include "imaging/filters.hpp"

#include <cmath>
#include <sstream>

namespace tissuewarp::imaging {

namespace {

void require_mask(const Volume& mask, double radius_mm) {
    if (mask.empty() || mask.channels() != 1) throw InvalidInput("morphology: give a mask of one component");
    if (std::isfinite(radius_mm) && radius_mm >= 0.0) return;
    std::ostringstream message;
    message << "morphology: radius " << radius_mm << " mm; give a finite length of 0 mm or more";
    throw InvalidInput(message.str());
}

/// Voxels whose centre lies within the radius of the centre of a voxel != 0, as 0 and 255. Exact for every radius.
cv::Mat grown(const cv::Mat& mask, const Eigen::Vector3d& spacing, double radius_mm) {
    cv::Mat squared = detail::squared_to_voxels(mask, 0, spacing[0]);
    for (const int axis : {1, 2}) {
        constexpr double widest_window = 16;  // voxels to a side: of wider ones parabolas are the faster
        if (radius_mm <= widest_window * spacing[axis])
            detail::window_pass(squared, axis, spacing[axis], radius_mm);
        else
            detail::parabola_pass(squared, axis, spacing[axis]);
    }
    // A voxel exactly on the sphere belongs to the ball, in spite of rounding.
    const double limit = std::pow(radius_mm * (1.0 + 1e-6), 2);
    cv::Mat near;
    cv::compare(squared, limit, near, cv::CMP_LE);
    return near;
}

cv::Mat as_mask(const Volume& volume) {
    cv::Mat mask;
    cv::compare(volume.voxels, 0, mask, cv::CMP_NE);
    return mask;
}

/// 0 and 255 become 0 and 1.
Volume zero_one(const Geometry& grid, const cv::Mat& mask) {
    cv::Mat result;
    cv::min(mask, 1, result);
    return {grid, result};
}

}  // namespace

Volume dilate(const Volume& mask, double radius_mm) {
    require_mask(mask, radius_mm);
    return zero_one(mask.geometry, grown(as_mask(mask), mask.geometry.spacing, radius_mm));
}

// What lies beyond the edge of the image is unknown, so it does not erode.
Volume erode(const Volume& mask, double radius_mm) {
    require_mask(mask, radius_mm);
    cv::Mat background;
    cv::compare(mask.voxels, 0, background, cv::CMP_EQ);
    cv::Mat kept;
    cv::compare(grown(background, mask.geometry.spacing, radius_mm), 0, kept, cv::CMP_EQ);
    return zero_one(mask.geometry, kept);
}

Volume open(const Volume& mask, double radius_mm) {
    return dilate(erode(mask, radius_mm), radius_mm);
}

Volume close(const Volume& mask, double radius_mm) {
    return erode(dilate(mask, radius_mm), radius_mm);
}

}  // namespace tissuewarp::imaging
