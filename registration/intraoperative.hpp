#pragma once
/// What was seen during the operation: the data that a registration may use, alone or together.

#include "imaging/volume.hpp"

#include <Eigen/Geometry>

#include <optional>
#include <vector>

namespace tissuewarp::registration {

/// Points on a part of the organ's outer surface: a laser or stereo patch, the sweep of a tracked probe.
struct SurfacePoints {
    Eigen::Matrix3Xd points;    ///< 3 × P, LPS mm, fixed frame
    Eigen::Matrix3Xd normals;   ///< 3 × P, unit, outward, or 3 × 0 when not known
    double deviation_mm = 1.0;  ///< standard deviation of a point along the normal
};

/// Points of the tissue that were found again: anatomical landmarks, vessel branchings.
struct PointPairs {
    Eigen::Matrix3Xd moving, fixed;  ///< 3 × P, LPS mm, each in its frame
    double deviation_mm = 1.0;       ///< standard deviation of a pair along each axis
};

/// Centre lines of vessels or ducts before the operation, and points along the same ones during it, from ultrasound or
/// cone-beam CT: a part of them, in pieces, in any order, some of them of something else.
struct Curves {
    std::vector<Eigen::Matrix3Xd> moving;  ///< polylines, 3 × P each, LPS mm, moving frame
    Eigen::Matrix3Xd fixed;                ///< points, 3 × P, LPS mm, fixed frame
    Eigen::Matrix3Xd tangents;  ///< 3 × P, along the vessel at each point, unit, either sign; 0 where not known, or
                                ///< 3 × 0 when none is
    double deviation_mm = 1.0;  ///< standard deviation of a point along each axis across the vessel
};

/// Any of it may be absent; something must be there.
struct Intraoperative {
    std::optional<imaging::Volume> labels = std::nullopt;  ///< label map with the numbers of the preoperative one
    std::optional<imaging::Volume> image = std::nullopt;   ///< grey values of the tissue, not segmented, any modality
    /// Further images of the tissue, each matched with the contrast of the model that has its number; beside `image`.
    std::vector<imaging::Volume> contrasts = {};
    std::optional<SurfacePoints> surface = std::nullopt;
    std::optional<PointPairs> points = std::nullopt;
    std::optional<Curves> curves = std::nullopt;
    /// Where the organ is known to lie (moving → fixed), by navigation or another registration, in place of where the
    /// headers place it: the alignment begins there, and without one it stays there.
    std::optional<Eigen::Isometry3d> start = std::nullopt;
};

}  // namespace tissuewarp::registration
