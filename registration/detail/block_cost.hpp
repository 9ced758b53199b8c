#pragma once
/// The cost of placing a block of the moving image somewhere in the fixed one, over lattices of displacements.

#include "registration/detail/block_window.hpp"

namespace tissuewarp::registration::detail {

struct Block {
    Voxel centre{0, 0, 0};     ///< voxel of the moving grid
    int radius = 4;            ///< voxels: the block has 2 radius + 1 along each axis
    double least_share = 0.5;  ///< of its voxels, that must be seen in both images
};

/// Costs on the cube of ± reach voxels about a centre, i fastest.
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
    /// The voxel of an entry.
    [[nodiscard]] Voxel place(std::size_t n) const {
        const Voxel d = displacement(n);
        return {centre[0] + d[0], centre[1] + d[1], centre[2] + d[2]};
    }
    /// At a voxel within the lattice.
    [[nodiscard]] double cost(const Voxel& at) const {
        const int i = at[0] - centre[0] + reach, j = at[1] - centre[1] + reach, k = at[2] - centre[2] + reach;
        return costs[static_cast<std::size_t>(i + side() * (j + side() * k))];
    }
};

/// Costs of one block of an image about places of another. A cost is the mean squared difference between the block and
/// its like about a voxel, over the voxels seen in both; infinity when they are less than the least share.
/// SelfSimilarityContext: of descriptors, over channels, 0..1. CrossCorrelation: 2 (1 − r), which is the mean squared
/// difference of blocks brought to mean 0 and variance 1. The images have the same spacing; what lies off a grid is not
/// seen.
class BlockCosts {
public:
    /// `block` is one of `shown`. Both surroundings outlive this.
    BlockCosts(Surroundings& shown, Surroundings& looked_at, const Block& block);

    /// Costs about a voxel of the image looked at; of every `stride`-th row of the block along j and k: 3 takes a ninth
    /// of the time for a first look. The radius of the block and the reach are up to 31 together.
    [[nodiscard]] CostLattice lattice(const Voxel& centre, int reach, int stride);

private:
    Surroundings &shown_, &looked_at_;
    Block block_;
    std::vector<std::int64_t> differences_, voxels_;

    void descriptor_costs(CostLattice& lattice, int stride);
    void correlation_costs(CostLattice& lattice, int stride) const;
};

}  // namespace tissuewarp::registration::detail
