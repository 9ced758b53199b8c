#pragma once
/// The rigid placement of a whole surface on points of a part of it.

#include "core/observer.hpp"
#include "meshing/search/surface_tree.hpp"
#include "registration/pose/alignment.hpp"
#include "registration/pose/rival_poses.hpp"
#include "registration/pose/surface_data.hpp"

namespace tissuewarp::registration::detail {

/// How the pose of a surface is searched beside AlignmentOptions. Chosen by hand; on which data is not recorded, but
/// for the steps before descents that met go on as one: the surface of the liver phantom was looked at.
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
    int fine_points = 800;                                   ///< of their descent
    int fine_first_steps = 10, fine_steps = 30;              ///< with all of them; with those that still differ
    double fine_first_scale = 2, fine_middle_scale = 1.7;    ///< over the final scale
    double damping = 1e-3;        ///< of the weights' sum: what the points do not show does not move
    double least_step_mm = 1e-3;  ///< a descent ends below it
};

struct SurfacePose {
    ChosenPose pose;      ///< costs by the area of the points; 1 where no triangle fits
    double scale_mm = 0;  ///< s of the costs
};

/// Starts: the placement that the headers say, and rotations of 25° about twelve axes, each with the middle of the
/// points on places all over the surface that face their way. Each start goes down a symmetric point-to-plane distance
/// (Rusinkiewicz, ACM Trans Graph 38 (2019) 85) under Geman–McClure weights whose scale falls (graduated non-convexity:
/// Yang et al., IEEE RA-L 5 (2020) 1127), with few points at first; the best with more, as long as they do not meet.
/// The cost decides, and where several poses fit alike the headers (choose_pose). `surface` is the one in `model`.
SurfacePose search_surface_pose(const meshing::SurfaceTree& model, const meshing::SurfaceMesh& surface,
                                const SurfaceData& data, const AlignmentOptions& options, Observer& observer);

}  // namespace tissuewarp::registration::detail
