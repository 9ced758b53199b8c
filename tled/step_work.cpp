#include "tled/step_work.hpp"

#include "tled/cpu/fan_layout.hpp"
#include "tled/model/patches.hpp"

#include <algorithm>

namespace tissuewarp::tled {
namespace {

/// Costs of a pass structure: of each element and of each node.
struct Counts {
    double bytes_of_element, bytes_of_node, flops_of_element, flops_of_node;
};

StepWork per_element(const RestState& rest, const Counts& counts) {
    const double nodes = double(rest.node_count) / std::max(1, rest.element_count());
    return {counts.bytes_of_element + nodes * counts.bytes_of_node,
            counts.flops_of_element + nodes * counts.flops_of_node};
}

// From H = F − I: differences of displacements 9, H 45, cof H and J − 1 45, factors of the stress 30, P 40, three
// forces and their scale 54, the fourth 6; adding them up at the nodes 12.
constexpr double flops_of_gathering_element = 9 + 45 + 45 + 30 + 40 + 54 + 6 + 12;
constexpr double flops_of_node_step = 4 * 3;

/// Slots are a patch's nodes; a shared slot's node has slots in other patches too.
struct PatchCounts {
    double slots = 0, shared_slots = 0, sharers = 0;  ///< sharers: slots of its node, summed over shared slots
    double fans = 0;
};

PatchCounts counted(const std::vector<detail::Patch>& patches, int node_count) {
    std::vector<int> slots_of_node(static_cast<std::size_t>(node_count), 0);
    PatchCounts counts;
    for (const detail::Patch& patch : patches) {
        counts.slots += double(patch.node.size());
        counts.fans += double(patch.fan.size());
        for (const int node : patch.node) ++slots_of_node[static_cast<std::size_t>(node)];
    }
    for (const int slots : slots_of_node) {
        if (slots < 2) continue;
        counts.shared_slots += slots;
        counts.sharers += double(slots) * slots;
    }
    return counts;
}

// Bytes of a slot: inverse mass 4, increment read and written 24; unless a workgroup keeps its one patch in shared
// memory, X is read and u read and written, 36. A force that is left for others or taken is 16, with its address 20; a
// fan is 16. Operations of a tetrahedron: edges and normals 27, H with 1/(6 V) 70, cof H and J − 1 45, factors 30, P
// 40, three forces 51, their rounding 10; of a fan its first edges and last two nodes 40.
StepWork patch_step_work(const RestState& rest, const GpuStepShape& shape) {
    const std::vector<detail::Patch> patches = detail::cut_into_patches(rest, {shape.patch_tets, shape.longest_fan});
    const PatchCounts c = counted(patches, rest.node_count);
    const double elements = std::max(1, rest.element_count());
    double bytes = 28 * c.slots + 16 * c.shared_slots + 20 * c.sharers + 16 * c.fans;
    if (static_cast<std::size_t>(shape.at_once) < patches.size()) bytes += 36 * c.slots;
    const double flops =
        elements * (27 + 70 + 45 + 30 + 40 + 51 + 10) + 40 * c.fans + 3 * c.sharers + flops_of_node_step * c.slots;
    return {bytes / elements, flops / elements};
}

}  // namespace

// An element's record of 60 B (nodes, derivatives, volume, material); displacements read, forces added to in the
// element pass; u, increment and force read and written and masses read in the node pass. F from differences 63, C 45,
// adjugate and J 41, law 35, S 18, P 45, forces 54, added to nodes 18.
StepWork scalar_step_work(const RestState& rest) {
    return per_element(rest, {60, 12 + 24 + 24 + 24 + 24 + 12, 63 + 45 + 41 + 35 + 18 + 45 + 54 + 18, 15});
}

// A patch's copy of its nodes and what its fans leave stay in a core's cache and count as no bytes; shared slots are
// patches' nodes that another patch has too. Bytes of a lane, padding included: derivatives, volume, modulus 44; of a
// fan's node 2, of its place in the list of its node 2; of a slot number, first place and u 24, of a shared one its
// force written and read and its entry 36; of a node force 16, increment and u read and written 64, mass, load and
// mask 48. Operations of a tetrahedron: relative displacements 3, H 45, cof F − I, E and J − 1 72, factors of the
// stress 26, P 63, three forces 54 and their sum 3; of a fan its first nodes and last force 15; of a node 18.
StepWork cpu_step_work(const RestState& rest) {
    const detail::FanLayout layout = detail::fan_layout(rest, detail::suggested_patch_tets(rest.element_count()));
    const double elements = std::max(1, rest.element_count()), lanes = double(layout.batches.element.size());
    const double nodes = rest.node_count, slots = double(layout.nodes.node.size());
    const double places = double(layout.nodes.scalar_place.size()), fans = (places - elements) / 3;
    const double bytes = 44 * lanes + 2 * double(layout.nodes.fan_node.size()) + 2 * places + 24 * slots +
                         36 * (slots - double(layout.own_nodes)) + (16 + 64 + 48) * nodes;
    const double flops = elements * (3 + 45 + 72 + 26 + 63 + 54 + 3) + 15 * fans + 3 * places + 18 * nodes;
    return {bytes / elements, flops / elements};
}

// Indices 16, rest data 48, corner forces 64 written and read, their list 16. Nodes: u read by the elements, first
// entry and valence 8, u and increment read and written, masses.
StepWork render_pass_step_work(const RestState& rest) {
    return per_element(rest,
                       {16 + 48 + 64 + 64 + 16, 16 + 8 + 32 + 32 + 16, flops_of_gathering_element, flops_of_node_step});
}

// Two passes move what the render passes do.
StepWork gpu_step_work(const RestState& rest, const GpuStepShape& shape) {
    return shape.patch_tets == 0 ? render_pass_step_work(rest) : patch_step_work(rest, shape);
}

}  // namespace tissuewarp::tled
