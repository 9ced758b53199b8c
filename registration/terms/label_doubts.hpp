#pragma once
/// What is said against a registration to labels: label by label, and why, as far as labels tell.

#include "registration/options.hpp"
#include "registration/pose/label_boundaries.hpp"
#include "registration/prepare.hpp"
#include "registration/result.hpp"

#include <string>
#include <vector>

namespace tissuewarp::registration::detail {

/// What each label may show without a doubt. Chosen on the brain shift, the liver, the torso onto itself, maps of the
/// brain shift that were turned, mirrored, renumbered and cut, and seeds 21 to 24 of `tissuewarp study coverage`
/// (phantom, bent, organ): where results were right, every label overlapped by 0.89 or more and lay within 0.8 mm;
/// where they were wrong, one overlapped by 0.37 or less and lay 9.9 mm off or more.
struct LabelFitLimits {
    double grid_mm = 2;        ///< labels are compared on the fixed grid, coarsened to about this spacing
    double least_dice = 0.5;   ///< of model and fixed map …
    double within_voxels = 1;  ///< … unless the boundaries lie within so many of the largest spacing, mean: a plate of
                               ///< a voxel that lies a voxel off has no overlap at all
    double most_apart_mm = 4;      ///< mean distance of the boundaries of one label, however well it overlaps …
    double most_apart_voxels = 2;  ///< … and at least so many of the largest spacing
    int fewest_voxels = 27;        ///< a label of fewer in both maps may be a speck: what it lacks is a notice
    double most_worse = 0.01;      ///< overlap of all labels together lost against where the headers place them
    double most_cut = 0.01;        ///< area where one map alone is cut off by its image, over 6 V^⅔, V the volume
};
inline constexpr LabelFitLimits label_fit_limits{};

/// What tells that a placement is wrong, beside LabelRivalOptions and on the same data.
struct LabelPoseLimits {
    double most_distance_mm = 3;  ///< of the boundaries after alignment, mean, truncated at AlignmentOptions::trim_mm
};
inline constexpr LabelPoseLimits label_pose_limits{};

/// Doubts of the labels that the model, whose `moving` are, and `fixed` show after a registration; where there are
/// some, rivals of the placement and of the pairing of labels are sought for the cause, which takes as long as several
/// alignments. `result` holds alignment and deformation.
std::vector<Doubt> doubts_of_labels(const PreparedModel& prepared, LabelBoundaries& moving, LabelBoundaries& fixed,
                                    const UpdateOptions& options, const UpdateResult& result);

/// The likely cause and remedy where labels have no boundary in common: numbers that are exchanged, if any.
std::string why_nothing_matches(const LabelBoundaries& moving, const LabelBoundaries& fixed);

}  // namespace tissuewarp::registration::detail
