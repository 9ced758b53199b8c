#pragma once
/// The rigid placement of a whole surface on points of a part of it.

#include "core/observer.hpp"
#include "meshing/search/surface_tree.hpp"
#include "registration/pose/alignment.hpp"
#include "registration/pose/surface_data.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

/// How the pose of a surface is searched beside AlignmentOptions. Chosen by hand; on which data is not recorded.
struct SurfacePoseOptions {
    double least_cosine = 0.5;          ///< between the normals of a point and its triangle
    double start_rotation_deg = 25;     ///< about the corners of an icosahedron
    int start_places = 40;              ///< on the surface
    std::size_t facing_one_of = 10;     ///< points about the middle one, whose mean normal says how a start faces
    double scales_of_trim = 2;          ///< AlignmentOptions::trim_mm over the final robust scale …
    double least_scale_deviations = 3;  ///< … which is at least so many deviations of a point
    double reach = 4;                   ///< of matches, over a step's scale
    int coarse_points = 150, coarse_steps = 15;              ///< of the descent of each start
    double coarse_first_scale = 6, coarse_last_scale = 1.5;  ///< over the final scale
    std::size_t finalists = 12;                              ///< that go on
    int fine_points = 800, fine_steps = 40;                  ///< of their descent
    double fine_first_scale = 2;                             ///< over the final scale
    double damping = 1e-3;        ///< of the weights' sum: what the points do not show does not move
    double least_step_mm = 1e-3;  ///< a descent ends below it
    double same_pose_mm = 8;      ///< mean over the surface: poses closer than this are one, others rivals
};

struct SurfacePose {
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed
    double cost = 0;  ///< mean of d²/(d² + s²) over the area of the points, s = `scale_mm`; 1 where no triangle fits
    double scale_mm = 0;    ///< s
    double rival_cost = 1;  ///< of the best placement far from this one
    double rival_mm = 0;    ///< and how far the surface lies from it there, mean over nodes

    /// d at which d²/(d² + s²) is the cost.
    [[nodiscard]] double typical_distance_mm() const { return scale_mm * std::sqrt(cost / std::max(1e-9, 1 - cost)); }
};

/// Starts: the placement that the headers say, and rotations of 25° about twelve axes, each with the middle of the
/// points on places all over the surface that face their way. Each start goes down a symmetric point-to-plane distance
/// (Rusinkiewicz, ACM Trans Graph 38 (2019) 85) under Geman–McClure weights whose scale falls (graduated non-convexity:
/// Yang et al., IEEE RA-L 5 (2020) 1127), with few points at first; the best with more. The cost decides. `surface` is
/// the one in `model`.
SurfacePose search_surface_pose(const meshing::SurfaceTree& model, const meshing::SurfaceMesh& surface,
                                const SurfaceData& data, const AlignmentOptions& options, Observer& observer);

}  // namespace tissuewarp::registration::detail
