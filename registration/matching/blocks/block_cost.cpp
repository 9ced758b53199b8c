#include "registration/matching/blocks/block_cost.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissuewarp::registration::detail {

namespace {

constexpr double nowhere = std::numeric_limits<double>::infinity();
constexpr double full_difference = 255.0 * 255.0 * descriptor_channels;

Voxel corner(const Voxel& centre, int radius) {
    return {centre[0] - radius, centre[1] - radius, centre[2] - radius};
}

}  // namespace

BlockCosts::BlockCosts(Surroundings& shown, Surroundings& looked_at, const Block& block)
    : shown_(shown), looked_at_(looked_at), block_(block) {}

CostLattice BlockCosts::lattice(const Voxel& centre, int reach, int stride) {
    CostLattice result{centre, reach, {}};
    const auto side = static_cast<std::size_t>(result.side());
    result.costs.resize(side * side * side);
    shown_.cover(block_.centre, block_.radius);
    looked_at_.cover(centre, block_.radius + reach);
    const int shifts = result.side();
    const RowComparison comparison{2 * block_.radius + 1, first_row(block_.radius, stride), stride, shifts,
                                   descriptor_channels};
    const double least = least_voxels(block_.radius, stride, block_.least_share);
    differences_.resize(static_cast<std::size_t>(shifts));
    voxels_.resize(differences_.size());
    const VoxelRows block = shown_.rows(corner(block_.centre, block_.radius));
    const Voxel first = corner(centre, block_.radius + reach);
    double* cost = result.costs.data();
    for (int k = 0; k < shifts; ++k)
        for (int j = 0; j < shifts; ++j) {
            squared_differences(block, looked_at_.rows({first[0], first[1] + j, first[2] + k}), comparison,
                                differences_.data(), voxels_.data());
            for (std::size_t i = 0; i < voxels_.size(); ++i)
                *cost++ = double(voxels_[i]) < least ? nowhere
                                                     : double(differences_[i]) / (full_difference * double(voxels_[i]));
        }
    return result;
}

}  // namespace tissuewarp::registration::detail
