// One workgroup per block: from the lowest of its candidates, by all rows, downhill to the lowest of 27 places until that
// is the place itself; and the costs about it.
// Needs: index, match, match.block.
//! define MOST_STEPS

#define CUBE 27u
#define CENTRE 13u
#define LANES 32u

/// Entries of the cube of places about where a block is expected.
layout(std430, binding = BINDING_MATCH_SOURCE) readonly buffer MatchCandidates { uint candidate[]; };

/// Where the walk ended, and 1; 0 in place of 1 where it led nowhere.
struct Walk { ivec4 end; float costs[28]; };
layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchWalks { Walk walk[]; };

shared ivec3 place[CUBE];
shared uint difference[CUBE], voxels[CUBE];
shared float cost[CUBE];

/// Sum and count of a place over one word of the block's rows, of three a voxel; the first of them counts the voxel.
uvec2 compare_word(ivec3 shown, ivec3 looked, int word) {
    Overlap overlap = overlap_of(shown, looked);
    int x = word / 3 - block_radius, part = word % 3;
    uvec2 sum = uvec2(0u);
    if (x < overlap.first.x || x > overlap.last.x) return sum;
    uint counts = part == 0 ? 1u : 0u;
    for (int k = overlap.first.z; k <= overlap.last.z; ++k) {
        int a = shown_offset(shown + ivec3(x, overlap.first.y, k));
        int b = looked_offset(looked + ivec3(x, overlap.first.y, k));
        for (int j = overlap.first.y; j <= overlap.last.y; ++j, a += shown_size.x, b += looked_size.x) {
            if ((shown_seen[a] & looked_seen[b]) == 0u) continue;
            sum.x += squared_difference(shown_word[3 * a + part], looked_word[3 * b + part]);
            sum.y += counts;
        }
    }
    return sum;
}

/// Fills in `cost` of the first `count` places: LANES invocations side by side read a row's words, which lie side by
/// side.
void compare(ivec3 shown, uint count) {
    uint local = gl_LocalInvocationID.x;
    if (local < CUBE) {
        difference[local] = 0u;
        voxels[local] = 0u;
    }
    barrier();
    uint words = uint(3 * (2 * block_radius + 1));
    for (uint which = local / LANES; which < count; which += WORKGROUP_SIZE / LANES)
        for (uint word = local % LANES; word < words; word += LANES) {
            uvec2 sum = compare_word(shown, place[which], int(word));
            atomicAdd(difference[which], sum.x);
            atomicAdd(voxels[which], sum.y);
        }
    barrier();
    if (local < CUBE)
        cost[local] = local < count ? cost_of(uvec2(difference[local], voxels[local]), walk_least) : nowhere;
    barrier();
}

/// The first of the lowest costs.
uint lowest() {
    uint least = 0u;
    for (uint n = 1u; n < CUBE; ++n)
        if (cost[n] < cost[least]) least = n;
    return least;
}

/// The lowest candidate; a single one is not compared.
bool start(SoughtBlock block, out ivec3 at) {
    uint first = uint(block.shown.w), count = uint(block.looked.w), local = gl_LocalInvocationID.x;
    at = block.looked.xyz;
    if (count == 1u) at += place_in_cube(candidate[first], reach);
    float least = nowhere;
    for (uint begin = 0u; begin < count && count > 1u; begin += CUBE) {
        uint some = min(count - begin, CUBE);
        if (local < some) place[local] = block.looked.xyz + place_in_cube(candidate[first + begin + local], reach);
        barrier();
        compare(block.shown.xyz, some);
        uint best = lowest();
        if (cost[best] < least) {
            least = cost[best];
            at = place[best];
        }
        barrier();
    }
    return count == 1u || least < nowhere;
}

void main() {
    uint n = invocation_index() / WORKGROUP_SIZE, local = gl_LocalInvocationID.x;
    if (n >= block_count) return;
    ivec3 at;
    bool walking = start(sought[n], at), arrived = false;
    for (uint step = 0u; step < MOST_STEPS && walking; ++step) {
        if (local < CUBE) place[local] = at + place_in_cube(local, 1);
        barrier();
        compare(sought[n].shown.xyz, CUBE);
        uint best = lowest();
        arrived = cost[best] < nowhere && !(cost[best] < cost[CENTRE]);
        walking = cost[best] < nowhere && !arrived;
        if (walking) at = place[best];
        barrier();
    }
    if (local == 0u) walk[n].end = ivec4(at, arrived ? 1 : 0);
    if (local < CUBE) walk[n].costs[local] = cost[local];
}
