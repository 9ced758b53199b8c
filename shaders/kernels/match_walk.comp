// One workgroup per block: from the lowest of its candidates, by all rows, downhill to the lowest of 27 places until that
// is the place itself; and the costs about it. Candidates are places that a first look puts lowest
// (registration/matching/blocks/block_engine.hpp); of a way back there is one, where the block is expected.
// Needs: index, match, match.block.
//! define MOST_STEPS
//! define MOST_CANDIDATES
//! define CANDIDATES_ONE_OF

#define CUBE 27u
#define CENTRE 13u
#define LANES 32u         // divides WORKGROUP_SIZE
#define COLUMNS 81u       // of a block along k that are compared at a time; WORKGROUP_SIZE is thrice as many or more
#define MOST_SIDE 19      // of a slice that is looked at: most_radius of GpuBlockEngine, and one more on both sides
#define SQUARES 3         // after the three words of a voxel
#define VOXELS_SHIFT 24u  // above a column's difference: 17 voxels of twelve squares of eight bits

/// Of the cube of places about where each block is expected, block after block.
layout(std430, binding = BINDING_MATCH_SOURCE) readonly buffer MatchLooks { float look_cost[]; };

/// Where the walk ended, and 1; 0 in place of 1 where it led nowhere.
struct Walk { ivec4 end; float costs[28]; };
layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchWalks { Walk walk[]; };

/// What is sought on the way back: the block about where the walk ended, from where the first block lies; and whether it
/// ended.
layout(std430, binding = BINDING_MATCH_PARTIAL) writeonly buffer MatchBack { SoughtBlock back[]; };

shared ivec3 place[CUBE];
shared uint least_cost, least_place, lower;
shared uint difference[CUBE], voxels[CUBE];
shared float cost[CUBE];
shared vec4 looked_slice[2][MOST_SIDE * MOST_SIDE], shown_slice[2][COLUMNS];
shared uint column_sum[CUBE][COLUMNS];

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

/// Where an entry of a slice lies in its image: offset and index along k in the first slice that is read.
struct Entry {
    int offset, z;
    bool shown, on_plane;
};

bool within(int n, int size) { return n >= 0 && n < size; }
bool within(ivec2 voxel, ivec2 size) { return within(voxel.x, size.x) && within(voxel.y, size.y); }

/// Entries of `looked_slice`, then those of `shown_slice`, whose columns begin with `first_column`.
Entry entry_of(ivec3 shown, ivec3 looked, int n, int first_column) {
    int side = 2 * block_radius + 1, wide = side + 2, own = n - wide * wide, column = first_column + own;
    if (own < 0) {
        ivec3 voxel = looked + ivec3(n % wide, n / wide, 0) - (block_radius + 1);
        return Entry(looked_offset(voxel), voxel.z, false, within(voxel.xy, looked_size.xy));
    }
    ivec3 voxel = shown + ivec3(column % side, column / side, 0) - block_radius;
    bool on_plane = own < int(COLUMNS) && column < side * side && within(voxel.xy, shown_size.xy);
    return Entry(shown_offset(voxel), voxel.z, true, on_plane);
}

/// What is read of a voxel some slices on: a word, or all three where squares are asked for, and whether it counts.
uvec4 read(Entry entry, int step, int part) {
    bool shown = entry.shown;
    ivec3 size = shown ? shown_size.xyz : looked_size.xyz;
    if (!entry.on_plane || !within(entry.z + step, size.z) || (shown && step > 2 * block_radius)) return uvec4(0u);
    int at = entry.offset + step * size.x * size.y, word = 3 * at + part % SQUARES;
    uvec4 found = uvec4(shown ? shown_word[word] : looked_word[word], 0u, 0u, min(shown ? shown_seen[at] : looked_seen[at], 1u));
    if (part == SQUARES)
        found.yz = shown ? uvec2(shown_word[word + 1], shown_word[word + 2]) : uvec2(looked_word[word + 1], looked_word[word + 2]);
    return found;
}

vec4 channels_of(uint word) { return vec4(uvec4(word, word >> 8, word >> 16, word >> 24) & 0xffu); }

/// Four channels, or the sum of squares of all and 1; zeros where the voxel does not count.
vec4 value_of(uvec4 found, int part) {
    vec4 first = channels_of(found.x);
    if (part < SQUARES) return float(found.w) * first;
    vec4 second = channels_of(found.y), third = channels_of(found.z);
    float squares = dot(first, first) + dot(second, second) + dot(third, third);
    return float(found.w) * vec4(squares, 1.0, 0.0, 0.0);
}

void put(int n, vec4 value, int room) {
    int wide = 2 * block_radius + 3, own = n - wide * wide;
    if (own < 0)
        looked_slice[room][n] = value;
    else if (own < int(COLUMNS))
        shown_slice[room][own] = value;
}

/// Sums over a column, of three places beside each other along j, for places before, at and after a slice of it along k.
struct Sums { vec3 before, here, after; };

float plus_product(float sum, vec4 a, vec4 b) { return fma(a.w, b.w, fma(a.z, b.z, fma(a.y, b.y, fma(a.x, b.x, sum)))); }

/// Whole numbers below 2^24, which floats hold exactly.
vec3 plus_products(vec3 sum, vec4 own, vec4 a, vec4 b, vec4 c) {
    return vec3(plus_product(sum.x, own, a), plus_product(sum.y, own, b), plus_product(sum.z, own, c));
}

/// |a|² where both count, and |b|².
vec3 plus_squares(vec3 sum, vec4 own, vec4 a, vec4 b, vec4 c) {
    return sum + own.x * vec3(a.y, b.y, c.y) + own.y * vec3(a.x, b.x, c.x);
}

vec3 plus_voxels(vec3 sum, vec4 own, vec4 a, vec4 b, vec4 c) { return sum + own.y * vec3(a.y, b.y, c.y); }

/// Leaves in `column_sum` what COLUMNS columns of the block add to each place of the cube, an invocation for each column
/// and each of the cube's slices across i. Slices of both images pass through shared memory, the next one being read
/// while one is compared; first the products of each third of the channels, then the squares.
void compare_columns(ivec3 shown, ivec3 at, int first_column) {
    int local = int(gl_LocalInvocationID.x), own = local % int(COLUMNS), slice = min(local / int(COLUMNS), 2);
    int side = 2 * block_radius + 1, wide = side + 2, steps = side + 2;
    int column = min(first_column + own, side * side - 1), corner = column % side + slice + wide * (column / side);
    int second = local + int(WORKGROUP_SIZE);
    bool are_more = wide * wide + int(COLUMNS) > int(WORKGROUP_SIZE);  // entries than invocations
    Entry entry = entry_of(shown, at, local, first_column), further = entry_of(shown, at, second, first_column);
    put(local, value_of(read(entry, 0, 0), 0), 0);
    if (are_more) put(second, value_of(read(further, 0, 0), 0), 0);
    barrier();
    ivec3 difference_before = ivec3(0), difference_here = ivec3(0), difference_after = ivec3(0);
    vec3 none = vec3(0.0);
    Sums voxels = Sums(none, none, none);
    int room = 0;
    for (int part = 0; part <= SQUARES; ++part) {
        Sums sums = Sums(none, none, none);
        vec4 last = vec4(0.0), now = vec4(0.0);
        for (int step = 0; step < steps; ++step) {
            bool turn = step + 1 == steps;
            int next_step = turn ? 0 : step + 1, next_part = turn ? part + 1 : part;
            uvec4 found = uvec4(0u), found_further = uvec4(0u);
            if (next_part <= SQUARES) found = read(entry, next_step, next_part);
            if (next_part <= SQUARES && are_more) found_further = read(further, next_step, next_part);
            vec4 next = shown_slice[room][own];
            vec4 a = looked_slice[room][corner], b = looked_slice[room][corner + wide], c = looked_slice[room][corner + 2 * wide];
            if (part < SQUARES) {
                sums.before = plus_products(sums.before, next, a, b, c);
                sums.here = plus_products(sums.here, now, a, b, c);
                sums.after = plus_products(sums.after, last, a, b, c);
            } else {
                sums.before = plus_squares(sums.before, next, a, b, c);
                sums.here = plus_squares(sums.here, now, a, b, c);
                sums.after = plus_squares(sums.after, last, a, b, c);
                voxels.before = plus_voxels(voxels.before, next, a, b, c);
                voxels.here = plus_voxels(voxels.here, now, a, b, c);
                voxels.after = plus_voxels(voxels.after, last, a, b, c);
            }
            if (turn || step == block_radius) {  // squares of half a column stay below 2^24
                int sign = part < SQUARES ? -2 : 1;
                difference_before += sign * ivec3(sums.before);
                difference_here += sign * ivec3(sums.here);
                difference_after += sign * ivec3(sums.after);
                sums = Sums(none, none, none);
            }
            last = now;
            now = next;
            room = 1 - room;
            put(local, value_of(found, next_part), room);
            if (are_more) put(second, value_of(found_further, next_part), room);
            barrier();
        }
    }
    for (int j = 0; j < 3 && local < int(3u * COLUMNS); ++j) {
        int first = slice + 3 * j;
        column_sum[first][own] = uint(difference_before[j]) | uint(voxels.before[j]) << VOXELS_SHIFT;
        column_sum[first + 9][own] = uint(difference_here[j]) | uint(voxels.here[j]) << VOXELS_SHIFT;
        column_sum[first + 18][own] = uint(difference_after[j]) | uint(voxels.after[j]) << VOXELS_SHIFT;
    }
}

/// Adds up `column_sum`, an invocation for each ninth of a place's columns.
void add_columns() {
    uint local = gl_LocalInvocationID.x, which = local / 9u, first = local % 9u * (COLUMNS / 9u);
    if (which >= CUBE) return;
    uvec2 sum = uvec2(0u);
    for (uint n = 0u; n < COLUMNS / 9u; ++n) {
        uint packed_sum = column_sum[which][first + n];
        sum += uvec2(packed_sum & ((1u << VOXELS_SHIFT) - 1u), packed_sum >> VOXELS_SHIFT);
    }
    atomicAdd(difference[which], sum.x);
    atomicAdd(voxels[which], sum.y);
}

/// Fills in `cost` of the cube about a place.
void compare_cube(ivec3 shown, ivec3 at) {
    uint local = gl_LocalInvocationID.x;
    if (local < CUBE) {
        difference[local] = 0u;
        voxels[local] = 0u;
    }
    int columns = (2 * block_radius + 1) * (2 * block_radius + 1);
    for (int first = 0; first < columns; first += int(COLUMNS)) {
        compare_columns(shown, at, first);
        barrier();
        add_columns();
        barrier();
    }
    if (local < CUBE) cost[local] = cost_of(uvec2(difference[local], voxels[local]), walk_least);
    barrier();
}

/// The first of the lowest costs.
uint lowest() {
    uint least = 0u;
    for (uint n = 1u; n < CUBE; ++n)
        if (cost[n] < cost[least]) least = n;
    return least;
}

bool adjoins_any(ivec3 at, uint count) {
    for (uint n = 0u; n < count; ++n)
        if (all(lessThanEqual(abs(at - place[n]), ivec3(1)))) return true;
    return false;
}

/// Of a block's first look: leaves the lowest cost of the places that adjoin none of those chosen so far in `least_cost`,
/// its first place in `least_place`, which is the number of places where there is none.
void find_lowest(uint first_look, uint places, ivec3 looked, uint chosen) {
    uint local = gl_LocalInvocationID.x, own = places;
    float least = nowhere;
    if (local == 0u) {
        least_cost = floatBitsToUint(nowhere);
        least_place = places;
        lower = 0u;
    }
    barrier();
    for (uint n = local; n < places; n += WORKGROUP_SIZE) {
        float found = look_cost[first_look + n];
        if (found < least && !adjoins_any(looked + place_in_cube(n, reach), chosen)) {
            least = found;
            own = n;
        }
    }
    if (own < places) atomicMin(least_cost, floatBitsToUint(least));  // positive floats are in the order of their bits
    barrier();
    if (own < places && floatBitsToUint(least) == least_cost) atomicMin(least_place, own);
    barrier();
}

/// Leaves in `lower` how many places come before one: of lower cost, or of the same and first.
void count_lower(uint first_look, uint places, uint at) {
    uint local = gl_LocalInvocationID.x, own = 0u;
    float limit = look_cost[first_look + at];
    for (uint n = local; n < places; n += WORKGROUP_SIZE) {
        float found = look_cost[first_look + n];
        if (found < limit || (found == limit && n < at)) ++own;
    }
    if (own > 0u) atomicAdd(lower, own);
    barrier();
}

/// Leaves candidates in `place`, and returns their number.
uint choose(uint n, ivec3 looked) {
    uint side = uint(2 * reach + 1), places = side * side * side, chosen = 0u;
    for (bool more = true; more && chosen < MOST_CANDIDATES; chosen += uint(more)) {
        find_lowest(n * places, places, looked, chosen);
        uint lowest_place = least_place;
        more = lowest_place < places;
        if (more) {
            count_lower(n * places, places, lowest_place);
            more = lower < 1u + places / CANDIDATES_ONE_OF;
            if (more && gl_LocalInvocationID.x == 0u) place[chosen] = looked + place_in_cube(lowest_place, reach);
        }
        barrier();
    }
    return chosen;
}

/// The lowest candidate; a single one is not compared.
bool start(uint n, out ivec3 at) {
    SoughtBlock block = sought[n];
    at = block.looked.xyz;
    if (is_way_back != 0u) return block.shown.w != 0;
    uint count = choose(n, at);
    if (count == 0u) return false;
    uint best = 0u;
    if (count > 1u) {
        compare(block.shown.xyz, count);
        best = lowest();
    }
    at = place[best];
    bool seen = count == 1u || cost[best] < nowhere;
    barrier();
    return seen;
}

void main() {
    uint n = invocation_index() / WORKGROUP_SIZE, local = gl_LocalInvocationID.x;
    if (n >= block_count) return;
    ivec3 at;
    bool walking = start(n, at), arrived = false;
    for (uint step = 0u; step < MOST_STEPS && walking; ++step) {
        compare_cube(sought[n].shown.xyz, at);
        uint best = lowest();
        arrived = cost[best] < nowhere && !(cost[best] < cost[CENTRE]);
        walking = cost[best] < nowhere && !arrived;
        if (walking) at += place_in_cube(best, 1);
        barrier();
    }
    if (local == 0u) {
        walk[n].end = ivec4(at, arrived ? 1 : 0);
        if (is_way_back == 0u) back[n] = SoughtBlock(ivec4(at, arrived ? 1 : 0), sought[n].shown);
    }
    if (local < CUBE) walk[n].costs[local] = cost[local];
}
