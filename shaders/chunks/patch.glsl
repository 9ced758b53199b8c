// Needs: bindings.
// Gives: what a workgroup knows of its patch of the mesh (tled/gpu/patch_layout.hpp), whose nodes are slots. A node that
// more patches share has a slot in each, all with the same state; shared nodes come first, most shared ones before.
//! define SLOTS

// Sizes that differ from mesh to mesh are uniforms: what a driver compiled for one mesh then serves the next. Only the size of
// shared memory is a constant, SLOTS, in steps of 64; a patch has room for as many slots in all arrays.
layout(location = 6) uniform uint patch_count;
layout(location = 7) uniform uint slots_of_all;     // SLOTS patch_count
layout(location = 8) uniform uint fan_room;         // of each patch, as below
layout(location = 9) uniform uint source_room;
layout(location = 10) uniform uint neighbour_room;
layout(location = 11) uniform uint workgroup_count;
layout(location = 12) uniform float contributions;  // most nodes of fans that are one node

/// Three for each patch: (slots | fans << 16; material | entries of sources before the pairs << 16; bits of the volumetric modulus, kPa; neighbours | shared slots << 16),
/// then the slots of the planes 0 to 15 of its sources, 16 bits each. Behind those of all patches their fans (patch.fans).
layout(std430, binding = BINDING_PATCH_HEAD) readonly buffer PatchHead { uvec4 patch_head[]; };
/// source_room for each patch, in planes: plane j holds the slot of the j-th of the patches that share the node of a slot, for
/// as many slots as have so many sharers, three at least. Behind them, of each node that two share, the other's slot.
layout(std430, binding = BINDING_PATCH_SOURCES) readonly buffer PatchSources { uint patch_sources[]; };

struct Patch {
    uint index, slots, fans, material;
    float volumetric_modulus;
    uint first_pair, neighbours, shared_slots;
    uvec4 planes_0_to_7, planes_8_to_15;
};

/// A workgroup has every workgroup_count-th patch from this one on.
uint first_patch_of_workgroup() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }

Patch patch_of(uint p) {
    uint at = 3u * p;
    uvec4 head = patch_head[at];
    return Patch(p, head.x & 0xffffu, head.x >> 16u, head.y & 0xffffu, uintBitsToFloat(head.z),
                 head.y >> 16u, head.w & 0xffffu, head.w >> 16u, patch_head[at + 1u], patch_head[at + 2u]);
}

uvec4 low_counts(uvec4 pairs) { return uvec4(pairs.x & 0xffffu, pairs.x >> 16u, pairs.y & 0xffffu, pairs.y >> 16u); }
uvec4 high_counts(uvec4 pairs) { return low_counts(pairs.zwxy); }
