// Patches of the mesh, a workgroup for each or for several in turn. Stages of a time step, each 1 or 0:
//   ADVANCES  sums the forces that all patches left for its shared nodes and advances them; every patch that shares a node
//             does so alike, bit by bit;
//   VOLUMES   computes the volume changes of its nodes (averaged pressure) and leaves them to the patches that share these;
//   FORCES    computes the forces of its tetrahedra and leaves those on shared nodes likewise; its own nodes, which no other
//             patch holds, go on to the next step at once, unless the run ends here.
// A stage that reads what others left runs in a later dispatch. So T4 advances and computes forces in one dispatch, and
// averaged pressure takes two. PERSISTS 1 instead goes on for `steps` in one dispatch: a patch waits for its neighbours alone,
// and all workgroups must run at the same time, which OpenGL does not promise: one that has waited too long says so, and all
// give up. STAYS 1 where each of these has one patch, whose positions and displacements stay in shared memory, and with
// STRESSES_STAY 1 its viscous stresses.
// Needs: the patch chunks of its stages and what they need; patch.neighbours where PERSISTS is 1.
//! define ADVANCES
//! define VOLUMES
//! define FORCES
//! define AVERAGES
//! define PERSISTS
//! define STAYS
//! define STRESSES_STAY

layout(location = 0) uniform uint first_step;  // of this dispatch; its parity tells which forces the first step reads
layout(location = 1) uniform float momentum;
layout(location = 2) uniform float gain;
layout(location = 3) uniform uint steps;
layout(location = 4) uniform uint run_begin;  // between steps of a run, own nodes are ahead of shared ones
layout(location = 5) uniform uint run_end;

/// Of each patch as bits: the largest force of a fan on a node in the last step (sum of the components' sizes, six times
/// mN), and the largest volume change (24 times mm³).
layout(std430, binding = BINDING_PATCH_LARGEST) COHERENT buffer PatchLargest { uvec2 patch_largest[]; };

// Of a patch in hand, `fan` is the first fan of the invocation and `largest` patch_largest of the step before.

Patch begin_patch(uint p, out uvec4 fan, out uvec2 largest) {
    Patch here = patch_of(p);
    fan = fan_of(here, gl_LocalInvocationID.x);
    largest = patch_largest[p];
    return here;
}

void load_nodes(Patch here) {
    for (uint i = gl_LocalInvocationID.x; i < here.slots; i += WORKGROUP_SIZE) load_node(here.index * SLOTS + i, i);
}

#if ADVANCES
void advance_nodes(Patch here, uint step) {
    uint advancing = step == run_begin ? here.slots : here.shared_slots;
    for (uint i = gl_LocalInvocationID.x; i < advancing; i += WORKGROUP_SIZE) {
        uint s = here.index * SLOTS + i;
        Moving m = moving(s);
        vec3 f = i < here.shared_slots ? received_force(here, i, step & 1u) : own_force(s, step & 1u);
        advance_node(s, i, m, f, momentum, gain);
    }
}
#endif

#if VOLUMES
void leave_volumes(Patch here, uvec4 fan, inout uint largest, uint step) {
    uint lane = gl_LocalInvocationID.x;
    for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE) node_volume[i] = 0;
    if (lane == 0u) largest_of_patch = 0u;
    barrier();
    float scale = scale_for(largest);
    bool finite = compute_volumes(here, fan, scale, largest);
    for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE) send_volume(here.index * SLOTS + i, i, scale, finite);
    if (lane == 0u) patch_largest[here.index].y = largest;
#if PERSISTS
    tell_neighbours(here, 2u * step + 1u);
#endif
}
#endif

#if FORCES
/// An invocation handles the same nodes here as in begin_patch and advance_nodes.
void leave_forces(Patch here, uvec4 fan, inout uint largest, uint step) {
    uint lane = gl_LocalInvocationID.x;
    uint first_slot = here.index * SLOTS;
    for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE) {
#if AVERAGES
        find_pressure(here, i);
#endif
        clear_force(i);
    }
    if (lane == 0u) largest_of_patch = 0u;
    barrier();
    float scale = scale_for(largest);
    bool finite = compute_forces(here, fan, parameters_of(here.material), scale, largest);
    float unit = finite ? force_unit(scale) : not_a_number();
    uint sent = step + 1u == run_end ? here.slots : here.shared_slots;
    for (uint i = lane; i < sent; i += WORKGROUP_SIZE)
        send_force(first_slot + i, 1u - (step & 1u), force_here(i, unit));
    if (lane == 0u) patch_largest[here.index].x = largest;
#if PERSISTS
    tell_neighbours(here, 2u * step + 2u);
#endif
    for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE)
        if (i >= sent) advance_node(first_slot + i, i, moving(first_slot + i), force_here(i, unit), momentum, gain);
}
#endif

/// The part of a step that needs what neighbours left in the step before; false where they did not come.
bool begin_step(Patch here, uvec4 fan, inout uvec2 largest, uint step) {
#if PERSISTS
    if (step != first_step && !neighbours_arrived(here, 2u * step)) return false;
#endif
#if ADVANCES
    advance_nodes(here, step);
#endif
#if VOLUMES
    leave_volumes(here, fan, largest.y, step);
#endif
    return true;
}

/// The rest, which with averaged pressure needs what they left in begin_step.
bool end_step(Patch here, uvec4 fan, inout uvec2 largest, uint step) {
#if FORCES
#if PERSISTS && AVERAGES
    if (!neighbours_arrived(here, 2u * step + 1u)) return false;
#endif
    leave_forces(here, fan, largest.x, step);
#endif
    return true;
}

#if PERSISTS
void end_patch(Patch here) {
#if STAYS
    for (uint i = gl_LocalInvocationID.x; i < here.slots; i += WORKGROUP_SIZE)
        store_displacement(here.index * SLOTS + i, i);
#if STRESSES_STAY
    leave_stresses(here);
#endif
#else
    barrier();  // before the next patch takes the shared memory
#endif
}

#if !STAYS
/// There and back: the patch that one sweep ends with is the next one's first, and its nodes are still in shared memory.
uint patch_in_turn(uint first, uint turn, uint turns, uint sweep) {
    return first + ((sweep & 1u) == 0u ? turn : turns - 1u - turn) * workgroup_count;
}
#endif

/// False where it came to no end.
bool run_steps(uint first) {
    uvec4 fan;
    uvec2 largest;
    bool good = true;
    uint step = first_step;
#if STAYS
    Patch here = begin_patch(first, fan, largest);
    load_nodes(here);
#if STRESSES_STAY
    take_stresses(here);
#endif
    for (; step != first_step + steps && good; ++step) {
        good = begin_step(here, fan, largest, step);
        if (good) good = end_step(here, fan, largest, step);
    }
    end_patch(here);
#else
    uint turns = (patch_count - first + workgroup_count - 1u) / workgroup_count;
    for (; step != first_step + steps && good; ++step) {
        for (uint turn = 0u; turn < turns && good; ++turn) {
            Patch here = begin_patch(patch_in_turn(first, turn, turns, (1u + AVERAGES) * step), fan, largest);
            if (turn > 0u || step == first_step) load_nodes(here);
            good = begin_step(here, fan, largest, step);
#if !AVERAGES
            if (good) good = end_step(here, fan, largest, step);
#endif
            end_patch(here);
        }
#if AVERAGES
        // Not before all patches of the workgroup have left what the others, and each other, need for the second part.
        for (uint turn = 0u; turn < turns && good; ++turn) {
            Patch here = begin_patch(patch_in_turn(first, turn, turns, 2u * step + 1u), fan, largest);
            if (turn > 0u) load_nodes(here);
            good = end_step(here, fan, largest, step);
            end_patch(here);
        }
#endif
    }
#endif
    return good && step == first_step + steps;
}
#endif

void main() {
    uint first = first_patch_of_workgroup();
    if (first >= workgroup_count) return;
#if PERSISTS
    // A driver may end loops early: llvmpipe after 65535 turns of all loops of an invocation together.
    if (!run_steps(first) && gl_LocalInvocationID.x == 0u) give_up();
#else
    uvec4 fan;
    uvec2 largest;
    Patch here = begin_patch(first, fan, largest);
    load_nodes(here);
    begin_step(here, fan, largest, first_step);
    end_step(here, fan, largest, first_step);
#endif
}
