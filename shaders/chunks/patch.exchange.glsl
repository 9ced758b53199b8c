// Needs: bindings, patch. COHERENT is the qualifier of memory that workgroups exchange within a dispatch, or nothing.
// Gives: partial forces that patches leave for each other: send_force, received_force.
//! define COHERENT

/// Forces on slots, mN, of all slots twice; then one zero.
layout(std430, binding = BINDING_PATCH_FORCES) COHERENT buffer PatchForces { vec4 patch_forces[]; };

const uint other_material = 0x80000000u;  // flag of a source

void send_force(uint slot, uint parity, vec3 f) { patch_forces[parity * slots_of_all + slot] = vec4(f, 0.0); }
vec3 own_force(uint slot, uint parity) { return patch_forces[parity * slots_of_all + slot].xyz; }

/// Four planes of sources: how many slots each has, and where it begins.
struct Planes {
    uvec4 counts, first;
};

Planes planes_from(uint first, uvec4 counts) {
    uint b = first + counts.x;
    uint c = b + counts.y;
    return Planes(counts, uvec4(first, b, c, c + counts.z));
}

Planes first_planes(Patch here) { return planes_from(here.index * source_room, low_counts(here.planes_0_to_7)); }

/// The planes from 4 quad on, behind those before.
Planes next_planes(Patch here, Planes before, uint quad) {
    uvec4 counts = quad == 1u   ? high_counts(here.planes_0_to_7)
                   : quad == 2u ? low_counts(here.planes_8_to_15)
                                : high_counts(here.planes_8_to_15);
    return planes_from(before.first.w + before.counts.w, counts);
}

/// Sources of slot i in four planes; anything where a plane ends before.
uvec4 sources_of_planes(uint i, Planes planes) {
    uvec4 at = planes.first + mix(uvec4(0u), uvec4(i), lessThan(uvec4(i), planes.counts));
    return uvec4(patch_sources[at.x], patch_sources[at.y], patch_sources[at.z], patch_sources[at.w]);
}

/// The other slot of a node that two patches share.
uint source_of_pair(Patch here, uint i) {
    return patch_sources[here.index * source_room + here.first_pair + i - (here.planes_0_to_7.x & 0xffffu)];
}

/// Always four loads, none of which waits for another.
vec3 forces_of_planes(uint i, Planes planes, uint parity) {
    uvec4 source = sources_of_planes(i, planes) & ~other_material;
    uvec4 at = mix(uvec4(2u * slots_of_all), source + parity * slots_of_all, lessThan(uvec4(i), planes.counts));
    vec3 a = patch_forces[at.x].xyz;
    vec3 b = patch_forces[at.y].xyz;
    vec3 c = patch_forces[at.z].xyz;
    vec3 d = patch_forces[at.w].xyz;
    return ((a + b) + c) + d;
}

/// Sum of what all patches left for slot i of this one, in an order that all of them share; of two, any order is the same.
vec3 received_force(Patch here, uint i, uint parity) {
    Planes planes = first_planes(here);
    if (i >= planes.counts.x)
        return own_force(here.index * SLOTS + i, parity) +
               own_force(source_of_pair(here, i) & ~other_material, parity);
    vec3 sum = forces_of_planes(i, planes, parity);
    for (uint quad = 1u; quad < 4u; ++quad) {
        planes = next_planes(here, planes, quad);
        if (i >= planes.counts.x) break;
        sum += forces_of_planes(i, planes, parity);
    }
    return sum;
}
