// One workgroup per block: from the lowest of its candidates, by all rows, downhill to the lowest of 27 places until that
// is the place itself; and the costs about it.
// Needs: index, match, match.block.
//! define MOST_STEPS

#define CUBE 27u
#define CENTRE 13u
#define LANES 32u  // WORKGROUP_SIZE is nine times as many

/// Entries of the cube of places about where a block is expected.
layout(std430, binding = BINDING_MATCH_SOURCE) readonly buffer MatchCandidates { uint candidate[]; };

/// Where the walk ended, and 1; 0 in place of 1 where it led nowhere.
struct Walk { ivec4 end; float costs[28]; };
layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchWalks { Walk walk[]; };

shared ivec3 place[CUBE];
shared uint difference[CUBE], voxels[CUBE];
shared float cost[CUBE];
shared uint lane_difference[CUBE][3u * LANES + 1u], lane_voxels[CUBE][3u * LANES + 1u];

/// Sum and count of a place over one word of every third of the block's rows, of three a voxel; the first of them counts
/// the voxel.
uvec2 compare_word(ivec3 shown, ivec3 looked, int word, int first_row) {
    Overlap overlap = overlap_of(shown, looked);
    int x = word / 3 - block_radius, part = word % 3;
    uvec2 sum = uvec2(0u);
    if (x < overlap.first.x || x > overlap.last.x) return sum;
    uint counts = part == 0 ? 1u : 0u;
    for (int k = overlap.first.z; k <= overlap.last.z; ++k) {
        int first = overlap.first.y + first_row;
        int a = shown_offset(shown + ivec3(x, first, k)), b = looked_offset(looked + ivec3(x, first, k));
        for (int j = first; j <= overlap.last.y; j += 3, a += 3 * shown_size.x, b += 3 * looked_size.x) {
            uint both = min(shown_seen[a] & looked_seen[b], 1u);  // without a branch, loads need not wait for each other
            sum += both * uvec2(squared_difference(shown_word[3 * a + part], looked_word[3 * b + part]), counts);
        }
    }
    return sum;
}

/// Fills in `cost` of the first `count` places, which lie anywhere: LANES invocations side by side, for a third of the
/// block's rows, read a row's words, which lie side by side.
void compare(ivec3 shown, uint count) {
    uint local = gl_LocalInvocationID.x;
    if (local < CUBE) {
        difference[local] = 0u;
        voxels[local] = 0u;
    }
    barrier();
    uint words = uint(3 * (2 * block_radius + 1));
    for (uint part = local / LANES; part < 3u * count; part += WORKGROUP_SIZE / LANES)
        for (uint word = local % LANES; word < words; word += LANES) {
            uint which = part / 3u;
            uvec2 sum = compare_word(shown, place[which], int(word), int(part % 3u));
            atomicAdd(difference[which], sum.x);
            atomicAdd(voxels[which], sum.y);
        }
    barrier();
    if (local < CUBE)
        cost[local] = local < count ? cost_of(uvec2(difference[local], voxels[local]), walk_least) : nowhere;
    barrier();
}

/// Four channels of a voxel, the sum of their squares, and 1; zeros where the voxel does not count or is on no grid.
struct Word {
    ivec4 value;
    int square, counts;
};

Word word_of(uint channels, uint counts) {
    ivec4 value = ivec4(uvec4(channels, channels >> 8, channels >> 16, channels >> 24) & 0xffu);
    ivec4 squares = value * value;
    return Word(value, squares.x + squares.y + squares.z + squares.w, int(counts));
}

Word shown_at(int offset, int part, bool on_grid) {
    offset *= int(on_grid);
    uint counts = min(shown_seen[offset], 1u) * uint(on_grid);
    return word_of(shown_word[3 * offset + part] * counts, counts);
}

Word looked_at(int offset, int part, bool on_grid) {
    offset *= int(on_grid);
    uint counts = min(looked_seen[offset], 1u) * uint(on_grid);
    return word_of(looked_word[3 * offset + part] * counts, counts);
}

/// Words of three voxels beside each other along j. (Arrays of them would go to memory.)
struct Row { Word before, here, after; };

/// `row_on_grid`: of each of the three.
Row looked_row_at(int offset, int part, bvec3 row_on_grid, bool slice_on_grid) {
    return Row(looked_at(offset - looked_size.x, part, row_on_grid.x && slice_on_grid),
               looked_at(offset, part, row_on_grid.y && slice_on_grid),
               looked_at(offset + looked_size.x, part, row_on_grid.z && slice_on_grid));
}

/// Of three places beside each other along j: differences and voxels.
struct Sums { ivec3 difference, voxels; };

/// Squared difference of two words where both count, |a|² + |b|² - 2 a·b.
int difference_of(Word a, Word b) {
    ivec4 products = a.value * b.value;
    return a.square * b.counts + b.square * a.counts - 2 * (products.x + products.y + products.z + products.w);
}

void add(Word own, Row met, inout Sums sums) {
    sums.difference += ivec3(difference_of(own, met.before), difference_of(own, met.here), difference_of(own, met.after));
    sums.voxels += own.counts * ivec3(met.before.counts, met.here.counts, met.after.counts);
}

bool within(int n, int size) { return n >= 0 && n < size; }

/// Of nine places about `looked`, along j and then along k, over one word of every third of the block's rows from
/// `first_row` on: every word that is read is compared with all that it meets.
void compare_nine(ivec3 shown, ivec3 looked, int word, int first_row, inout Sums before, inout Sums here, inout Sums after) {
    int x = word / 3 - block_radius, part = word % 3;
    shown.x += x;
    looked.x += x;
    if (!within(shown.x, shown_size.x) || !within(looked.x, looked_size.x)) return;
    int shown_slice = shown_size.x * shown_size.y, looked_slice = looked_size.x * looked_size.y;
    for (int j = first_row - block_radius; j <= block_radius; j += 3) {
        int y = looked.y + j;
        bvec3 on_grid = bvec3(within(y - 1, looked_size.y), within(y, looked_size.y), within(y + 1, looked_size.y));
        bool shown_on_grid = within(shown.y + j, shown_size.y);
        ivec3 first = ivec3(0, j, -block_radius);
        int a = shown_offset(shown + first), b = looked_offset(looked + first), z = looked.z - block_radius;
        Row last = looked_row_at(b - looked_slice, part, on_grid, within(z - 1, looked_size.z));
        Row now = looked_row_at(b, part, on_grid, within(z, looked_size.z));
        for (int k = -block_radius; k <= block_radius; ++k, a += shown_slice) {
            b += looked_slice;
            ++z;
            Row next = looked_row_at(b, part, on_grid, within(z, looked_size.z));
            Word own = shown_at(a, part, shown_on_grid && within(shown.z + k, shown_size.z));
            add(own, last, before);
            add(own, now, here);
            add(own, next, after);
            last = now;
            now = next;
        }
    }
}

void leave(Sums sums, uint first, uint lane) {
    lane_difference[first][lane] = uint(sums.difference.x);
    lane_difference[first + 3u][lane] = uint(sums.difference.y);
    lane_difference[first + 6u][lane] = uint(sums.difference.z);
    lane_voxels[first][lane] = uint(sums.voxels.x);
    lane_voxels[first + 3u][lane] = uint(sums.voxels.y);
    lane_voxels[first + 6u][lane] = uint(sums.voxels.z);
}

/// Fills in `cost` of the cube about a place: LANES invocations side by side for each third of the block's rows and each
/// of the cube's three slices across i.
void compare_cube(ivec3 shown, ivec3 at) {
    uint local = gl_LocalInvocationID.x, lane = local % (3u * LANES), slice = local / (3u * LANES);
    Sums none = Sums(ivec3(0), ivec3(0)), before = none, here = none, after = none;
    uint words = uint(3 * (2 * block_radius + 1));
    ivec3 looked = at + ivec3(int(slice) - 1, 0, 0);
    for (uint word = lane % LANES; word < words; word += LANES)
        compare_nine(shown, looked, int(word), int(lane / LANES), before, here, after);
    leave(before, slice, lane);
    leave(here, slice + 9u, lane);
    leave(after, slice + 18u, lane);
    barrier();
    if (local < CUBE) {
        uvec2 sum = uvec2(0u);
        for (uint n = 0u; n < 3u * LANES; ++n) sum += uvec2(lane_difference[local][n], lane_voxels[local][n]);
        cost[local] = cost_of(uvec2(sum.x, sum.y / 3u), walk_least);  // each voxel has three words
    }
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
        compare_cube(sought[n].shown.xyz, at);
        uint best = lowest();
        arrived = cost[best] < nowhere && !(cost[best] < cost[CENTRE]);
        walking = cost[best] < nowhere && !arrived;
        if (walking) at += place_in_cube(best, 1);
        barrier();
    }
    if (local == 0u) walk[n].end = ivec4(at, arrived ? 1 : 0);
    if (local < CUBE) walk[n].costs[local] = cost[local];
}
