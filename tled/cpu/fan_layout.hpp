#pragma once
/// The patches and fans of tled/model/patches.hpp in the batches of the CPU kernels: batch_width fans of equal length
/// are a group, tetrahedron k of a group's fans is a batch. Nodes get internal numbers: those that one patch alone
/// moves come first, patch by patch, then all others.

#include "tled/cpu/cpu_batches.hpp"
#include "tled/model/patches.hpp"

namespace tissuewarp::tled::detail {

struct FanLayout {
    BatchLayout batches;
    std::vector<std::array<int, 4>> corner;  ///< element → the corner of the rest state that each of its corners is
    std::vector<FanGroup> groups;
    std::vector<FanPatch> patches;
    PatchNodes nodes;  ///< scalar_place in both lists of places

    std::vector<int> mesh_node;           ///< internal → mesh
    std::vector<std::uint32_t> internal;  ///< mesh → internal
    std::size_t own_nodes = 0;            ///< internal numbers below belong to one patch
};

/// Throws InvalidInput unless patches of `patch_tets` tetrahedra keep their places below 65536.
FanLayout fan_layout(const RestState& rest, int patch_tets);

/// Tetrahedra of a patch: small enough that what its tetrahedra leave stays in a second-level cache and threads find
/// enough patches, large enough that few nodes are shared.
int suggested_patch_tets(int element_count);

}  // namespace tissuewarp::tled::detail
