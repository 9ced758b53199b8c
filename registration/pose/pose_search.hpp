#pragma once
/// The search for a pose, whatever is compared: BOBYQA (Powell 2009) from several starts, coarse and then fine.

#include "registration/pose/alignment.hpp"

#include <functional>

namespace tissuewarp::registration::detail {

/// How a pose is searched beside AlignmentOptions. Chosen by hand; on which data is not recorded.
struct PoseSearchOptions {
    /// mm of cost per mm that the rotation carries the boundary: decides where the boundaries do not, as for a ball,
    /// and is far below the slope of a cost that does.
    double rotation_penalty = 5e-3;
    double coarse_trims = 10;                              ///< of the first searches, over AlignmentOptions::trim_mm
    int coarse_stride = 4;                                 ///< of their samples
    int coarse_evaluations = 200, fine_evaluations = 600;  ///< of the cost, at most
    std::size_t finalists = 2;                             ///< that are searched finely: precondition of the choice
    double least_first_step_mm = 0.5, trims_of_first_step = 4;  ///< first step, at least; trim over it
    double tolerance_mm = 0.01;                                 ///< of each parameter
};

/// Mean over every `stride`-th sample of the distance between what is aligned after `map`, each truncated at `trim_mm`.
using PoseCost = std::function<double(const Eigen::Affine3d& map, double trim_mm, int stride)>;

/// With `Similarity` a change of size is fitted along with the pose, so that it does not turn the organ; the answer is
/// the rigid part alone.
enum class PoseFreedom : unsigned { Rigid = 6, Similarity = 7 };

/// Starts: as the headers say, centroids matched, and rotations about the moving centroid. `moving_points` (3 × P, LPS
/// mm) give the centre and the radius of gyration.
Alignment search_pose(const PoseCost& cost, const Eigen::Matrix3Xd& moving_points,
                      const Eigen::Vector3d& fixed_centroid, PoseFreedom freedom, const AlignmentOptions& options,
                      Observer& observer);

}  // namespace tissuewarp::registration::detail
