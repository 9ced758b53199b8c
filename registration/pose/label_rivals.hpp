#pragma once
/// Whether labels would fit better turned round or in a mirror.

#include "core/observer.hpp"
#include "registration/options.hpp"
#include "registration/pose/label_boundaries.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::registration::detail {

/// How rivals of a placement are searched, and when one is better. Chosen on the brain shift, the liver, the torso onto
/// itself, and maps of the brain shift that were turned and mirrored: the right placements had mean distances of up to
/// 1.2 mm and no rival; a map turned by 180° 4.1 and 0.0, a mirrored one 3.5 and 0.9.
struct LabelRivalOptions {
    int samples = 1000;  ///< boundary points, half from each map: rivals are told apart by millimetres, not by tenths
    double look_above_mm = 1.5;  ///< mean distance of a placement, above which an alignment looks for one turned round
    double better = 0.6;         ///< a rival's distance over that of the placement found …
    double better_mm = 1;        ///< … and the least difference between them
    double least_turn_deg = 30;  ///< of a rival that is another placement
};
inline constexpr LabelRivalOptions label_rival_options{};

/// By LabelRivalOptions.
bool is_better_rival(double rival_mm, double than_mm);

/// Mean truncated distances of the boundaries (LabelDistance), each after a search from its start; mm.
struct LabelRivals {
    double found_mm = 0;    ///< from the placement that was found
    double turned_mm = 0;   ///< the best of those turned by 90° or 180° from it …
    double turned_deg = 0;  ///< … the angle between the two …
    Eigen::Isometry3d turned = Eigen::Isometry3d::Identity();  ///< … and where that one is, moving → fixed
    double mirrored_mm = 0;                                    ///< the best of the moving map's mirror image
};

/// Searches from all rotations that turn a cube into itself, and from all of its reflections, about the middle of the
/// moving map. `placement`: moving → fixed, as it was found. Throws InvalidInput when the maps share no label,
/// Cancelled.
LabelRivals label_rivals(LabelBoundaries& moving, LabelBoundaries& fixed, const Eigen::Isometry3d& placement,
                         const AlignmentOptions& options, Observer& observer = silent_observer());

}  // namespace tissuewarp::registration::detail
