// One invocation per block and place within `reach` of where it is expected: the cost of some rows of the block there.
// Needs: index, match, match.block.

layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchLooks { float look_cost[]; };

/// Sum and count over the voxels of a row of the block that count in both images.
uvec2 compare_row(RowPair row, ivec2 steps) {
    uvec2 sum = uvec2(0u);
    if (!row.on_grids) return sum;
    for (int x = steps.x; x <= steps.y; ++x) {
        int a = row.shown + x, b = row.looked + x;
        if ((shown_seen[a] & looked_seen[b]) == 0u) continue;
        for (int part = 0; part < 3; ++part)
            sum.x += squared_difference(shown_word[3 * a + part], looked_word[3 * b + part]);
        ++sum.y;
    }
    return sum;
}

void main() {
    uint n = invocation_index(), side = uint(2 * reach + 1), places = side * side * side;
    uint block = n / places, place = n - block * places;
    if (block >= block_count) return;
    ivec3 shown = sought[block].shown.xyz;
    ivec3 looked = sought[block].looked.xyz + place_in_cube(place, reach);
    ivec2 steps = steps_of(shown, looked);
    uvec2 sum = uvec2(0u);
    for (int dk = look_first - block_radius; dk <= block_radius; dk += look_stride)
        for (int dj = look_first - block_radius; dj <= block_radius; dj += look_stride)
            sum += compare_row(row_pair(shown, looked, ivec2(dj, dk)), steps);
    look_cost[n] = cost_of(sum, look_least);
}
