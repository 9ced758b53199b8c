// One workgroup per patch of the mesh. Stages of a time step, each 1 or 0:
//   ADVANCES  sums the forces that all patches left for its nodes and advances them; every patch that shares a node does so
//             alike, bit by bit;
//   VOLUMES   computes the volume changes of its nodes (averaged pressure) and leaves them to the patches that share these;
//   FORCES    computes the forces of its tetrahedra and leaves them likewise.
// A stage that reads what others left runs in a later dispatch. So T4 advances and computes forces in one dispatch, and
// averaged pressure takes two. PERSISTS 1 instead goes on for `steps` in one dispatch, with displacements in shared memory: a
// patch waits for its neighbours alone, and all patches must run at the same time, which OpenGL does not promise: one that has
// waited too long says so, and all give up.
// Needs: the patch chunks of its stages and what they need; patch.neighbours where PERSISTS is 1.
//! define ADVANCES
//! define VOLUMES
//! define FORCES
//! define AVERAGES
//! define PERSISTS

layout(location = 0) uniform uint first_step;  // its parity tells which forces the first step reads
layout(location = 1) uniform float momentum;
layout(location = 2) uniform float gain;
layout(location = 3) uniform uint steps;

/// Of each patch as bits: the largest force of a fan on a node in the last step (sum of the components' sizes, six times
/// mN), and the largest volume change (24 times mm³).
layout(std430, binding = BINDING_PATCH_LARGEST) buffer PatchLargest { uvec2 patch_largest[]; };

bool is_last(uint step) { return PERSISTS == 0 || step + 1u == first_step + steps; }

void main() {
    Patch here = patch_of_workgroup();
    if (here.index >= PATCHES) return;
    uint lane = gl_LocalInvocationID.x;
    uint first_slot = here.index * SLOTS;
    uvec4 first_fan = fan_of(here, lane);
    uvec2 largest = patch_largest[here.index];
    for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE) load_node(first_slot + i, i);
#if FORCES
    Parameters parameters = parameters_of(here.material);
    float unit = 0.0;
#endif
    uint step = first_step;
#if PERSISTS
    for (; step != first_step + steps; ++step) {
        if (step != first_step && !neighbours_arrived(here, 2u * step)) break;
#endif
        for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE) {
#if ADVANCES
            vec3 f = i < here.shared_slots ? received_force(here, i, step & 1u)
#if PERSISTS
                     : step != first_step ? force_here(i, unit)
#endif
                                          : own_force(first_slot + i, step & 1u);
            advance_node(first_slot + i, i, f, momentum, gain);
#endif
#if VOLUMES
            node_volume[i] = 0;
#elif AVERAGES
            find_pressure(here, i);
#endif
#if FORCES
            clear_force(i);
#endif
        }
        if (lane == 0u) largest_of_patch = 0u;
        barrier();
#if VOLUMES
        float volume_scale = scale_for(largest.y);
        bool finite = compute_volumes(here, first_fan, volume_scale, largest.y);
        for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE)
            send_volume(first_slot + i, i, volume_scale, finite);
#if FORCES
        tell_neighbours(here, 2u * step + 1u);
        if (!neighbours_arrived(here, 2u * step + 1u)) break;
        for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE) find_pressure(here, i);
        if (lane == 0u) largest_of_patch = 0u;
        barrier();
#endif
#endif
#if FORCES
        float scale = scale_for(largest.x);
        unit = compute_forces(here, first_fan, parameters, scale, largest.x) ? force_unit(scale) : not_a_number();
        for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE)
            if (i < here.shared_slots || is_last(step)) send_force(first_slot + i, 1u - (step & 1u), force_here(i, unit));
#endif
#if PERSISTS
        tell_neighbours(here, 2u * step + 2u);
    }
    // A driver may end loops early: llvmpipe after 65535 turns of all loops of an invocation together.
    if (lane == 0u && step != first_step + steps) give_up();
#endif
    if (lane == 0u) patch_largest[here.index] = largest;
#if ADVANCES
    for (uint i = lane; i < here.slots; i += WORKGROUP_SIZE) store_displacement(first_slot + i, i);
#endif
}
