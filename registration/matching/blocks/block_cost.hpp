#pragma once
/// The cost of placing a block of the moving image somewhere in the fixed one, over lattices of displacements.

#include "registration/matching/blocks/block_window.hpp"
#include "registration/matching/blocks/cost_lattice.hpp"

namespace tissuewarp::registration::detail {

/// Costs of one block of an image about places of another. A cost is the mean squared difference of descriptors between
/// the block and its like about a voxel, over channels and the voxels seen in both, 0..1; infinity when these are less
/// than the least share. The images have the same spacing; what lies off a grid is not seen.
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
};

}  // namespace tissuewarp::registration::detail
