// One invocation per block and place within `reach` of where it is expected: the cost of some rows of the block there.
// Needs: index, match, match.block.

layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchLooks { float look_cost[]; };

/// Sum and count over some voxels side by side that count in both images.
uvec2 compare_row(int a, int b, int count) {
    uvec2 sum = uvec2(0u);
    for (int end = a + count; a < end; ++a, ++b) {
        uint difference = 0u, both = min(shown_seen[a] & looked_seen[b], 1u);  // without a branch, loads need not wait
        for (int part = 0; part < 3; ++part)
            difference += squared_difference(shown_word[3 * a + part], looked_word[3 * b + part]);
        sum += both * uvec2(difference, 1u);
    }
    return sum;
}

void main() {
    uint n = invocation_index(), side = uint(2 * reach + 1), places = side * side * side;
    uint block = n / places, place = n - block * places;
    if (block >= block_count) return;
    ivec3 shown = sought[block].shown.xyz;
    ivec3 looked = sought[block].looked.xyz + place_in_cube(place, reach);
    Overlap overlap = overlap_of(shown, looked);
    int count = overlap.last.x - overlap.first.x + 1;
    uvec2 sum = uvec2(0u);
    for (int k = look_first - block_radius; k <= overlap.last.z; k += look_stride)
        for (int j = look_first - block_radius; j <= overlap.last.y; j += look_stride) {
            if (k < overlap.first.z || j < overlap.first.y) continue;
            ivec3 from = ivec3(overlap.first.x, j, k);
            sum += compare_row(shown_offset(shown + from), looked_offset(looked + from), count);
        }
    look_cost[n] = cost_of(sum, look_least);
}
