#pragma once
/// The rigid motion of what lies around the organ, from two images.

#include "registration/surroundings/window_fit.hpp"

#include <Eigen/Geometry>

#include <optional>
#include <vector>

namespace tissuewarp::registration::detail {

/// Where the surroundings are looked at, and what the preoperative image shows there.
struct Outside {
    imaging::Geometry grid;  ///< in the moving frame
    imaging::Volume weight;  ///< float32, 1 where it counts: outside the organ; 0 elsewhere
    imaging::Volume moving;  ///< float32, on the grid
    imaging::Volume fixed;   ///< float32, on its own grid
};

/// The motion (moving → fixed) that explains most around the organ: Gauss-Newton steps from each of `starts` on what
/// the best linear map of intensities in a window leaves, weighed down where that is much (Tukey's biweight); the best
/// of the starts. None where it leaves more than half of the image's variance, or where too few places count.
std::optional<Eigen::Isometry3d> motion_of_surroundings(const Outside& outside,
                                                        const std::vector<Eigen::Isometry3d>& starts);

}  // namespace tissuewarp::registration::detail
