#pragma once
/// Layers of voxels about a region, each with a neighbour in the layer before.

#include <array>
#include <cstdint>
#include <vector>

namespace tissuewarp::registration::detail {

/// A voxel, and which of its neighbours −i, +i, −j, +j, −k, +k lie in the region or a layer before: one bit each, in
/// this order.
struct GrownVoxel {
    std::uint32_t voxel = 0, neighbours = 0;
};

/// The first `count` layers of voxels beside those of `inside` (1 or 0 for each voxel, i fastest).
std::vector<std::vector<GrownVoxel>> growth_layers(std::vector<std::uint8_t> inside, const std::array<int, 3>& size,
                                                   int count);

}  // namespace tissuewarp::registration::detail
