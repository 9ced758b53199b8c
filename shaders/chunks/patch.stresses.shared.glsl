// Needs: index, patch.tissue.
// Gives: kept_stress, keep_stress: plane i of the viscous stresses of the tetrahedron in hand, which stay in shared memory from
// take_stresses to leave_stresses.
//! define PRONY_TERMS
//! define HAS_FIBRES
//! define PLACES

/// Planes of the PLACES of the patch.
shared vec2 stresses_here[3u * PRONY_TERMS * PLACES];

vec2 kept_stress(uint i) { return stresses_here[i * PLACES + place_here]; }
void keep_stress(uint i, vec2 q) { stresses_here[i * PLACES + place_here] = q; }

/// Places of a patch, and where each is among those of all.
uint places_of_patch() { return places / patch_count; }
uint place_in_memory(Patch here, uint at) {
    return at / fan_room * (fan_room * patch_count) + here.index * fan_room + at % fan_room;
}

/// Barriers stand between these and the forces.
void take_stresses(Patch here) {
    for (uint i = 0u; i < 3u * PRONY_TERMS; ++i)
        for (uint at = gl_LocalInvocationID.x; at < places_of_patch(); at += WORKGROUP_SIZE)
            stresses_here[i * PLACES + at] = patch_tissue[(HAS_FIBRES + i) * places + place_in_memory(here, at)];
}

void leave_stresses(Patch here) {
    for (uint i = 0u; i < 3u * PRONY_TERMS; ++i)
        for (uint at = gl_LocalInvocationID.x; at < places_of_patch(); at += WORKGROUP_SIZE)
            patch_tissue[(HAS_FIBRES + i) * places + place_in_memory(here, at)] = stresses_here[i * PLACES + at];
}
