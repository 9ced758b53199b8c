#pragma once
/// The cost of placing a block of the moving image somewhere in the fixed one, over a lattice of displacements.

#include "registration/detail/matching_image.hpp"

namespace tissuewarp::registration::detail {

struct Block {
    Voxel centre{0, 0, 0};     ///< voxel of the moving grid
    int radius = 4;            ///< voxels: the block has 2 radius + 1 along each axis
    double least_share = 0.5;  ///< of its voxels, that must be seen in both images
    int stride = 1;            ///< rows looked at along j and k: 2 takes a quarter of the time for a first look
};

/// Costs on the cube of ± reach voxels about a centre, i fastest. A cost is the mean squared difference between the
/// block and its like about a voxel of the fixed grid, over the voxels seen in both; infinity when they are less than
/// the least share. SelfSimilarityContext: of descriptors, over channels, 0..1. CrossCorrelation: 2 (1 − r), which is
/// the mean squared difference of blocks brought to mean 0 and variance 1.
struct CostLattice {
    Voxel centre{0, 0, 0};
    int reach = 0;
    std::vector<double> costs;

    [[nodiscard]] int side() const { return 2 * reach + 1; }
    /// Displacement from the centre, voxels.
    [[nodiscard]] Voxel displacement(std::size_t n) const {
        const int m = static_cast<int>(n), s = side();
        return {m % s - reach, m / s % s - reach, m / (s * s) - reach};
    }
};
/// The images have the same spacing. Any voxel may be asked for: what lies off a grid is not seen.
CostLattice cost_lattice(const MatchingImage& moving, const MatchingImage& fixed, const Block& block,
                         const Voxel& centre, int reach);

}  // namespace tissuewarp::registration::detail
