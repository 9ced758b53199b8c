#pragma once
/// Whether the tissue went where blocks were found.

#include "registration/matching/image_matching.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::registration::detail {

/// Over regions of a match's nearest neighbours: how far they lie from where the tissue went, all together.
struct LeftBehind {
    double distance_mm = 0;                           ///< the percentile asked for
    Eigen::Vector3d place = Eigen::Vector3d::Zero();  ///< of the match about which it is largest, LPS mm, moving frame
};

/// One block errs by a voxel, and by more along what it does not show; of a region the mean of `fixed − went`, weighted
/// by confidence, tells what it says in common. `went`: LPS mm, fixed frame, where the tissue of each block is now.
/// Nothing is left behind of fewer matches than `neighbours`.
LeftBehind left_behind(const std::vector<BlockMatch>& matches, const std::vector<Eigen::Vector3d>& went, int neighbours,
                       double percent);

}  // namespace tissuewarp::registration::detail
