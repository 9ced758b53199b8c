// Needs: bindings, index, patch.
// Gives: how patches that run at the same time wait for each other: tell_neighbours, neighbours_arrived, give_up.

/// neighbour_room for each patch: the patches that share a node with it.
layout(std430, binding = BINDING_PATCH_NEIGHBOURS) readonly buffer PatchNeighbours { uint patch_neighbours[]; };
/// How often each patch has left something, since ever; behind them one number that is not zero once a patch gave up waiting.
layout(std430, binding = BINDING_PATCH_PROGRESS) coherent volatile buffer PatchProgress { uint patch_progress[]; };

const uint most_polls = 1u << 15u;  // of the order of 20 ms

shared uint neighbours_missing;

/// The state of this dispatch is that of no step.
void give_up() { patch_progress[patch_count] = 1u; }

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
        uint neighbour = patch_neighbours[here.index * neighbour_room + n];
        bool arrived = false;
        for (uint polls = 1u; polls < most_polls; ++polls) {
            arrived = int(patch_progress[neighbour] - count) >= 0;
            if (arrived || ((polls & 0xffu) == 0u && patch_progress[patch_count] != 0u)) break;
        }
        if (!arrived) {
            give_up();
            neighbours_missing = 1u;
        }
    }
    memoryBarrierBuffer();
    barrier();
    return neighbours_missing == 0u;
}
