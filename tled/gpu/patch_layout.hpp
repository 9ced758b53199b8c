#pragma once
/// Patches in the arrays that shaders/kernels/patch_step.comp reads (contract there and in shaders/chunks/patch.glsl).

#include "tled/gpu/gpu_layout.hpp"
#include "tled/model/patches.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace tissuewarp::tled::detail {

/// More patches than this never meet at a node, unless patches are tiny.
inline constexpr std::size_t most_sharing_patches = 16;

/// Programs hold the number of slots of a patch as a constant: few different ones, or every mesh is compiled anew.
inline constexpr std::size_t slot_step = 64;
constexpr std::size_t slots_for(std::size_t nodes) {
    return (nodes + slot_step - 1) / slot_step * slot_step;
}

/// A node, a slot or a tetrahedron that is not there.
inline constexpr std::uint32_t no_slot = 0xffffffffU;

/// Every patch has as much room as the largest, so that addresses follow from the patch's number alone.
struct PatchCapacity {
    int patches = 0;
    int slots = 0;  ///< local nodes, in steps of slot_step
    int fans = 0;
    int longest_fan = 0;
    int sources = 0;        ///< slots that share a node with one of a patch, itself counted, over its shared nodes
    int neighbours = 0;     ///< patches that share a node with one
    int contributions = 0;  ///< most nodes of fans that are one node
};

struct PatchLayout {
    PatchCapacity capacity;
    std::vector<Uint4> head, fans;
    std::vector<float> rest;  ///< eight planes of all slots; inverse masses are left zero
    std::vector<std::uint32_t> sources, neighbours;
    std::vector<std::uint32_t> node_of_slot;  ///< 0xffffffff where a patch has fewer nodes
    std::vector<std::uint32_t> slot_of_node;  ///< of one of its patches; 0xffffffff of a node without tetrahedra
    /// Tetrahedron k of fan f of patch p is at (k patches + p) fans + f; 0xffffffff where there is none. Empty where
    /// tetrahedra have nothing for themselves, neither fibres nor viscous stresses.
    std::vector<std::uint32_t> element_of_place;
};

/// Largest number of patches that share a node.
std::size_t most_sharing(int node_count, const std::vector<Patch>& patches);

/// Throws InvalidInput when a patch is too large for 16-bit numbers, the whole for 32-bit ones, or more than
/// most_sharing_patches share a node.
PatchLayout patch_layout(const RestState& rest, const std::vector<Patch>& patches);

}  // namespace tissuewarp::tled::detail
