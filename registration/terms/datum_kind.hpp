#pragma once
/// What is known of each kind of data beside the deviation that is stated for it: errors that data share with their
/// neighbours, which no number of them averages out, and how far about them tissue counts as shown.

#include "imaging/geometry.hpp"
#include "registration/result.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

struct DatumKind {
    double shared_mm = 0;  ///< see PulledNode
    double shows_mm = 0;   ///< see PulledNode
};

/// Chosen on the random patients 1 to 9 of all three families (docs/decisions/error_model.md), but for the distances,
/// which are a matter of words.
struct SharedErrors {
    double label_voxels = 0.2;    ///< of labels, of the larger voxel of both maps
    double surface_voxels = 0.2;  ///< of points of a surface, of the voxel of the map that the model came from
    /// Of images, of the edge of a cube of the larger voxel's volume: times `full_agreement` over their agreement,
    /// where it is less. The random patients' images of one contrast agree by 0.8, degraded ones by 0.35.
    double image_voxels = 0.08, full_agreement = 0.8, least_agreement = 0.05;
    double points_mm = 0.3, curves_mm = 0.3;
    double shows_mm = 10;  ///< about data that lie apart; about an image's, which lie dense, none
};
inline constexpr SharedErrors shared_errors{};

/// Of motions of the organ as a whole, see HardlyShown.
struct HardlyTold {
    double of_turn = 0;      ///< deviation of a motion that springs do not feel, over how far the data turned the organ
    double below_share = 0;  ///< see HardlyShown
};
/// Chosen on the random patients 1 to 24 of the families *bent* and *labelled*; of surfaces and parts of images on 1 to
/// 16 (docs/decisions/error_model.md).
struct HardlyToldMotions {
    HardlyTold labels{0.3, 0.15}, surface{0.6, 0.1}, image{0.2, 0.15};
};
inline constexpr HardlyToldMotions hardly_told_motions{};

inline double larger_voxel(const imaging::Geometry& a, const imaging::Geometry& b) {
    return std::max(a.spacing.maxCoeff(), b.spacing.maxCoeff());
}
inline DatumKind label_kind(const imaging::Geometry& moving, const imaging::Geometry& fixed) {
    return {shared_errors.label_voxels * larger_voxel(moving, fixed), shared_errors.shows_mm};
}
inline DatumKind image_kind(const imaging::Geometry& moving, const imaging::Geometry& fixed, double agreement) {
    const double edge = std::cbrt(std::max(moving.voxel_volume(), fixed.voxel_volume()));
    const double doubtful = shared_errors.full_agreement /
                            std::clamp(agreement, shared_errors.least_agreement, shared_errors.full_agreement);
    return {shared_errors.image_voxels * edge * doubtful, 0};
}
/// Of ultrasound that the moving image explains by `agreement` (EchoMatches): fainter sweeps mislead wide parts of the
/// tissue in common. Chosen on `study coverage --problems ultrasound:1-20` and `faint-ultrasound:1-24`
/// (docs/decisions/ultrasound.md).
inline DatumKind ultrasound_kind(double agreement) {
    constexpr double clear_mm = 0.8, clear_agreement = 0.3, least_agreement = 0.05;
    return {clear_mm * std::sqrt(clear_agreement / std::clamp(agreement, least_agreement, clear_agreement)), 0};
}
inline DatumKind surface_kind(const imaging::Geometry& moving) {
    return {shared_errors.surface_voxels * moving.spacing.maxCoeff(), shared_errors.shows_mm};
}
inline constexpr DatumKind point_kind{shared_errors.points_mm, shared_errors.shows_mm};
inline constexpr DatumKind curve_kind{shared_errors.curves_mm, shared_errors.shows_mm};

}  // namespace tissuewarp::registration::detail
