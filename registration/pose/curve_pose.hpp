#pragma once
/// Where lines go through points when nothing bends.

#include "registration/pose/curve_matches.hpp"
#include "registration/result.hpp"

namespace tissuewarp::registration::detail {

/// How points along vessels place the organ. Chosen by hand; on which data is not recorded.
struct CurvePoseOptions {
    int passes = 60;             ///< of Gauss–Newton: the scale has come down by then
    double falling = 0.9;        ///< the robust scale of a pass over that of the pass before
    double first_of_median = 3;  ///< the first scale over the median distance
    double damping = 1e-4;       ///< of the mean eigenvalue: what the points do not tell does not move
    double bending_mm = 5;       ///< added to the last scale: what a rigid motion does not follow
};
inline constexpr CurvePoseOptions curve_pose_options{};

/// The rigid motion moving → fixed that minimises Σ share w ‖across‖², w = (s²/(s² + d²))² of the distance d of a point
/// to its nearest line, by Gauss–Newton with the lines matched anew in every step (iterative closest points: Besl and
/// McKay 1992, the distance to the line in place of that to a point). s falls to `last_scale_mm` from three times the
/// median distance at `start`. What the points do not tell, such as a shift along a single straight line, stays as
/// `start` has it.
Alignment closest_curve_pose(const meshing::CurveTree& lines, const CurvePoints& points, const Eigen::Isometry3d& start,
                             double last_scale_mm, double max_angle_deg);

}  // namespace tissuewarp::registration::detail
