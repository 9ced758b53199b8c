#pragma once
/// Block matching by an engine.

#include "registration/matching/blocks/block_engine.hpp"

namespace tissuewarp::registration::detail {

/// What a match of blocks says (docs/method.md, 7.5). Those of information were chosen on the two heads (brain shift,
/// brain sag) and the generated phantom of the tests, nothing on the lung.
struct BlockInformationRules {
    double independent_share = 0.1;  ///< of a block's voxels: the others repeat them. Chosen there
    double chance = 1.5;    ///< times √(2N): curvature of the lowest of places that differ by chance. Chosen there
    double leakage = 0.05;  ///< of the largest eigenvalue, along a plane edge. Chosen there
    double least_deviation = 0.05;  ///< voxels: what interpolation leaves of the best match. Chosen there
    /// Points on a coarse grid, beyond which every second, fourth … waits. Chosen by hand; data not recorded.
    int least_searched = 1000;
    /// Trace of a neighbour's weight, for a prediction to follow it. Chosen by hand; data not recorded.
    double least_voucher = 0.1;
};

/// match_blocks() in the image that an engine looks at, whose grid is `fixed`.
std::vector<BlockMatch> search_blocks(const MatchingTemplate& moving, const imaging::Geometry& fixed,
                                      BlockEngine& engine, const Eigen::Matrix3Xd& predicted,
                                      const BlockMatchingOptions& options, Observer& observer);

}  // namespace tissuewarp::registration::detail
