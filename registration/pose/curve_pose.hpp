#pragma once
/// Where lines go through points when nothing bends.

#include "registration/pose/curve_matches.hpp"
#include "registration/pose/rival_poses.hpp"
#include "registration/result.hpp"

namespace tissuewarp::registration::detail {

/// How points along vessels place the organ. Chosen by hand; on which data is not recorded, but for the starts: on the
/// random patients 1 to 60 of the families *bent* and *labelled*.
struct CurvePoseOptions {
    double start_rotation_deg = 25;  ///< of the starts, about the corners of an icosahedron
    int passes = 60;                 ///< of Gauss–Newton: the scale has come down by then
    double falling = 0.9;            ///< the robust scale of a pass over that of the pass before
    double first_of_median = 3;      ///< the first scale over the median distance
    double damping = 1e-4;           ///< of the mean eigenvalue: what the points do not tell does not move
    double bending_mm = 5;           ///< added to the last scale: what a rigid motion does not follow
};
inline constexpr CurvePoseOptions curve_pose_options{};

/// The rigid motion moving → fixed that minimises Σ share d²/(d² + s²) of the distances d of points to their nearest
/// lines, from turns about the middle of the points, where `start` has it and with that of the lines in its place. Each
/// start goes down Σ share w ‖across‖², w = (s²/(s² + d²))², by Gauss–Newton with the lines matched anew in every step
/// (iterative closest points: Besl and McKay 1992, the distance to the line in place of that to a point). s falls to
/// `last_scale_mm` from three times the median distance at `start`. What the points do not tell, such as a shift along
/// a single straight line, stays as the start has it. Where several fit alike the one that moves the organ least is
/// taken (choose_pose).
ChosenPose search_curve_pose(const meshing::CurveTree& lines, const CurvePoints& points, const Eigen::Isometry3d& start,
                             double last_scale_mm, double max_angle_deg);

}  // namespace tissuewarp::registration::detail
