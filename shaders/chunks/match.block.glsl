// Gives: blocks of one described image compared with places of another (registration/matching/blocks/block_cost.hpp).
// Needs: match.

/// A cost where too little is seen; costs are 0 to 1.
const float nowhere = 1e30;

layout(std430, binding = BINDING_MATCH_SEARCH) readonly buffer MatchSearch {
    ivec4 shown_size, looked_size;  // voxels along i, j, k of the image that shows the blocks, and of that looked at
    int block_radius;               // voxels
    int reach;                      // of a first look
    int look_stride;                // rows of a block from one that it takes to the next
    int look_first;                 // row
    float look_least, walk_least;   // voxels that must be seen in both
    uint block_count;
    uint is_way_back;               // of blocks that were found, from which a walk begins where they are expected
};

/// Centres of a block and of where it is expected; shown.w is 0 where there is none.
struct SoughtBlock { ivec4 shown, looked; };
layout(std430, binding = BINDING_MATCH_BLOCKS) readonly buffer MatchBlocks { SoughtBlock sought[]; };

/// Twelve channels of eight bits a voxel, three words; and which voxels count.
layout(std430, binding = BINDING_MATCH_MOVING) readonly buffer MatchShownWords { uint shown_word[]; };
layout(std430, binding = BINDING_MATCH_SEEN) readonly buffer MatchShownSeen { uint shown_seen[]; };
layout(std430, binding = BINDING_MATCH_DESCRIPTORS) readonly buffer MatchLookedWords { uint looked_word[]; };
layout(std430, binding = BINDING_MATCH_SHOWN) readonly buffer MatchLookedSeen { uint looked_seen[]; };

/// Of four channels each.
uint squared_difference(uint a, uint b) {
    ivec4 d = ivec4(uvec4(a, a >> 8, a >> 16, a >> 24) & 0xffu) - ivec4(uvec4(b, b >> 8, b >> 16, b >> 24) & 0xffu);
    d *= d;
    return uint(d.x + d.y + d.z + d.w);
}

/// Steps from the centre of the block that stay in it and on both grids, along i, j, k.
struct Overlap { ivec3 first, last; };

Overlap overlap_of(ivec3 shown, ivec3 looked) {
    ivec3 shown_beyond = shown_size.xyz - 1 - shown, looked_beyond = looked_size.xyz - 1 - looked;
    return Overlap(-min(ivec3(block_radius), min(shown, looked)),  // docs/decisions/gpu_signs.md
                   min(ivec3(block_radius), min(shown_beyond, looked_beyond)));
}

int shown_offset(ivec3 voxel) { return voxel.x + shown_size.x * (voxel.y + shown_size.y * voxel.z); }
int looked_offset(ivec3 voxel) { return voxel.x + looked_size.x * (voxel.y + looked_size.y * voxel.z); }

float cost_of(uvec2 sum, float least) {
    const float full_difference = 255.0 * 255.0 * 12.0;
    return float(sum.y) < least ? nowhere : float(sum.x) / (full_difference * float(sum.y));
}
