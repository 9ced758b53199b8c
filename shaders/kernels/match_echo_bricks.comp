// One invocation per shift and brick: what its voxels that the ultrasound shows add to the sums of a measure of likeness.
// Needs: index, match, match.echo, match.echo.linear or match.echo.structure.

layout(std430, binding = BINDING_ECHO_SEEN) readonly buffer EchoSeen { float seen[]; };
layout(std430, binding = BINDING_ECHO_TARGET) writeonly buffer EchoTarget { float target[]; };

void main() {
    uint index = invocation_index(), shift_number = index / brick_total();
    if (shift_number >= shift_count) return;
    ivec3 shift = place_in_cube(first_shift + shift_number, shift_reach);
    ivec3 first = brick_side * at_offset(int(index - shift_number * brick_total()), brick_count.xyz);
    ivec3 end = min(first + brick_side, voxel_count.xyz);
    float sums[sum_count];
    for (int s = 0; s < sum_count; ++s) sums[s] = 0.0;
    for (int k = first.z; k < end.z; ++k)
        for (int j = first.y; j < end.y; ++j)
            for (int i = first.x; i < end.x; ++i) {
                ivec3 at = ivec3(i, j, k), from = at - shift;
                int n = voxel_offset(at);
                bool inside = all(greaterThanEqual(from, ivec3(0))) && all(lessThan(from, voxel_count.xyz));
                if (inside && seen[n] != 0.0) add(n, voxel_offset(from), sums);
            }
    for (int s = 0; s < sum_count; ++s) target[uint(s) * sum_stride() + index] = sums[s];
}
