#pragma once
/// Whether labels would fit better turned round or in a mirror.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "registration/options.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::registration::detail {

/// How rivals of a placement are searched.
struct LabelRivalOptions {
    int samples = 1000;  ///< boundary points, half from each map: rivals are told apart by millimetres, not by tenths
};

/// Mean truncated distances of the boundaries (LabelDistance), each after a search from its start; mm.
struct LabelRivals {
    double found_mm = 0;     ///< from the placement that was found
    double turned_mm = 0;    ///< the best of those turned by 90° or 180° from it …
    double turned_deg = 0;   ///< … and the angle between the two
    double mirrored_mm = 0;  ///< the best of the moving map's mirror image, turned likewise
};

/// Searches from all rotations that turn a cube into itself, and from all of its reflections, about the middle of the
/// moving map. `placement`: moving → fixed, as it was found. Throws InvalidInput when the maps share no label,
/// Cancelled.
LabelRivals label_rivals(const imaging::Volume& moving, const imaging::Volume& fixed,
                         const Eigen::Isometry3d& placement, const AlignmentOptions& options,
                         Observer& observer = silent_observer());

}  // namespace tissuewarp::registration::detail
