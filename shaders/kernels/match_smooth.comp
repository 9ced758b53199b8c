// One invocation per voxel of the wide grid: smooths what the pass before left along the next axis, six maps at once.
// Needs: index, match, match.patch, match.distance, match.smoothed.

layout(location = 0) uniform uint axis;  // 1 or 2

void main() {
    uint offset = invocation_index();
    if (offset >= wide_count()) return;
    const uint reach = uint(octahedron_radius), wide = reach + uint(patch_radius);
    if (!within(wide_voxel(offset), uvec3(wide, wide, axis == 2u ? wide : reach))) return;
    uint stride = wide_stride()[axis];
    vec3 first = patch_window[0] * first_three(offset), last = patch_window[0] * last_three(offset);
    for (uint t = 1u; t <= uint(patch_radius); ++t) {
        uint before = offset - t * stride, after = offset + t * stride;
        first += patch_window[t] * (first_three(before) + first_three(after));
        last += patch_window[t] * (last_three(before) + last_three(after));
    }
    leave(offset, first, last);
}
