#pragma once
/// The search for a pose, whatever is compared: BOBYQA (Powell 2009) from several starts, coarse and then fine.

#include "registration/pose/alignment.hpp"

#include <functional>

namespace tissuewarp::registration::detail {

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
