#pragma once
/// Where the organ may lie in an image that shows it turned, whatever the headers say.

#include "core/observer.hpp"
#include "imaging/volume.hpp"
#include "registration/pose/rival_poses.hpp"

namespace tissuewarp::registration::detail {

/// Chosen by hand; seeds 1 to 10 of `study coverage --problems turned` were looked at.
struct TurnedImageOptions {
    double coarse_mm = 12, fine_mm = 6;             ///< voxels of the grids that are compared
    double beyond_mm = 12;                          ///< the organ's surroundings count so far from its nodes
    int coarse_samples = 300, fine_samples = 1500;  ///< about
    double start_rotation_deg = 25;                 ///< about the corners of an icosahedron, from each of 24
    double least_in_view = 0.5;                     ///< share of the samples
    std::size_t finalists = 24, most = 3;           ///< poses made finer; returned
    int evaluations = 200;                          ///< of each
    double first_step_mm = 6, tolerance_mm = 0.1;   ///< of shifts, and of turns at the radius of gyration
};

/// Rigid placements (moving → fixed) at which the moving image explains the fixed one by a linear map of its values:
/// rotations by multiples of 90° and around these, and all shifts, then the best and the headers' made finer (BOBYQA).
/// Costs are 1 − r² v, r the correlation, v the share of the samples in view. Those that explain more than the headers'
/// placement as it is, the best first, none nearly the same. Both images are float32; `seen` is the mask (uint8) of
/// what the fixed one shows; `nodes` (3 × N, LPS mm) are the organ's. Threads do not change the result. Throws
/// Cancelled.
std::vector<FoundPose> turned_poses(const imaging::Volume& moving, const Eigen::Matrix3Xd& nodes,
                                    const imaging::Volume& fixed, const imaging::Volume& seen, Observer& observer);

}  // namespace tissuewarp::registration::detail
