#pragma once
/// Block matching by an engine.

#include "registration/matching/blocks/block_engine.hpp"

namespace tissuewarp::registration::detail {

/// match_blocks() in the image that an engine looks at, whose grid is `fixed`.
std::vector<BlockMatch> search_blocks(const MatchingTemplate& moving, const imaging::Geometry& fixed,
                                      BlockEngine& engine, const Eigen::Matrix3Xd& predicted,
                                      const BlockMatchingOptions& options, Observer& observer);

}  // namespace tissuewarp::registration::detail
