// One invocation per block and place within `reach` of where it is expected: the cost of some rows of the block there.
// Needs: index, match, match.block.

layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchLooks { float look_cost[]; };

void main() {
    uint n = invocation_index(), side = uint(2 * reach + 1), places = side * side * side;
    uint block = n / places, place = n - block * places;
    if (block >= block_count) return;
    ivec3 shown = sought[block].shown.xyz;
    ivec3 looked = sought[block].looked.xyz + place_in_cube(place, reach);
    uvec2 sum = uvec2(0u);
    for (int dk = look_first - block_radius; dk <= block_radius; dk += look_stride)
        for (int dj = look_first - block_radius; dj <= block_radius; dj += look_stride)
            sum += compare_row(shown, looked, ivec2(dj, dk));
    look_cost[n] = cost_of(sum, look_least);
}
