#pragma once
/// Rigid alignment, the first stage of every registration.

#include "core/observer.hpp"
#include "imaging/volume.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::registration {

struct AlignmentOptions {
    double trim_mm = 8.0;           ///< distances beyond this count as this much: what deformed does not drag the pose
    double start_angle_deg = 30.0;  ///< the search starts from rotations of up to this angle about each axis
    int samples = 4000;             ///< boundary points used
};

struct Alignment {
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed
    double mean_distance_mm = 0;  ///< mean truncated distance of moving boundaries to the fixed ones
};

/// Minimises the mean truncated distance from the moving boundary to the fixed one (distance maps), of all labels together
/// and of the four largest that both maps hold, by BOBYQA (Powell 2009) from several starts: as the headers say, centroids
/// matched, and rotations about them.
/// Throws InvalidInput when the maps share no label.
Alignment align_labels(const imaging::Volume& moving_labels, const imaging::Volume& fixed_labels,
                       const AlignmentOptions& options = {}, Observer& observer = silent_observer());

}  // namespace tissuewarp::registration
