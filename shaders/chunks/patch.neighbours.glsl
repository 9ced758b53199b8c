// Needs: bindings, index, patch.
// Gives: how patches that run at the same time wait for each other: tell_neighbours, neighbours_arrived.
//! define NEIGHBOURS

/// NEIGHBOURS for each patch: the patches that share a node with it.
layout(std430, binding = BINDING_PATCH_NEIGHBOURS) readonly buffer PatchNeighbours { uint patch_neighbours[]; };
/// How often each patch has left something, since ever; behind them one number that is not zero once a patch gave up waiting.
layout(std430, binding = BINDING_PATCH_PROGRESS) coherent volatile buffer PatchProgress { uint patch_progress[]; };

const uint most_polls = 1u << 15u;  // of the order of 20 ms; llvmpipe ends any loop after 65535 turns

shared uint neighbours_missing;

/// All that this patch leaves for the `count`-th time is in place.
void tell_neighbours(Patch here, uint count) {
    memoryBarrierBuffer();
    barrier();
    if (gl_LocalInvocationID.x == 0u) {
        neighbours_missing = 0u;
        patch_progress[here.index] = count;
    }
}

/// Waits until all neighbours have left as much; false when that took too long, here or elsewhere.
bool neighbours_arrived(Patch here, uint count) {
    barrier();
    for (uint n = gl_LocalInvocationID.x; n < here.neighbours; n += WORKGROUP_SIZE) {
        uint neighbour = patch_neighbours[here.index * NEIGHBOURS + n];
        uint polls = 0u;
        while (int(patch_progress[neighbour] - count) < 0) {
            if (++polls < most_polls && ((polls & 0xffu) != 0u || patch_progress[PATCHES] == 0u)) continue;
            patch_progress[PATCHES] = 1u;
            neighbours_missing = 1u;
            break;
        }
    }
    memoryBarrierBuffer();
    barrier();
    return neighbours_missing == 0u;
}
