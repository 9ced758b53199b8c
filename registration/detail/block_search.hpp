#pragma once
/// Block matching in an image whose mask is known.

#include "registration/detail/matching_image.hpp"

namespace tissuewarp::registration::detail {

/// match_blocks() without the making of `fixed`.
std::vector<BlockMatch> search_blocks(const MatchingTemplate& moving, const SeenImage& fixed,
                                      const Eigen::Matrix3Xd& predicted, const BlockMatchingOptions& options,
                                      Observer& observer);

}  // namespace tissuewarp::registration::detail
