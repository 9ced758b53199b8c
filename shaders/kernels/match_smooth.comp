// One invocation per voxel of the wide grid: smooths what the pass before left along the next axis.
// Needs: index, match, match.patch.

layout(location = 0) uniform uint axis;  // 1 or 2

layout(std430, binding = BINDING_MATCH_SOURCE) readonly buffer MatchSource { float source[]; };
layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchTarget { float target[]; };

void main() {
    uint offset = invocation_index();
    if (offset >= wide_count()) return;
    const uint reach = uint(octahedron_radius), wide = reach + uint(patch_radius);
    if (!within(wide_voxel(offset), uvec3(wide, wide, axis == 2u ? wide : reach))) return;
    uint stride = wide_stride()[axis];
    float sum = patch_window[0] * source[offset];
    for (uint t = 1u; t <= uint(patch_radius); ++t)
        sum += patch_window[t] * (source[offset - t * stride] + source[offset + t * stride]);
    target[offset] = sum;
}
