// One invocation per voxel of the wide grid: squared differences of the six pairs, smoothed along i.
// Needs: index, match, match.octahedron, match.patch, match.smoothed.

layout(std430, binding = BINDING_MATCH_VALUE) readonly buffer MatchValue { float value[]; };

/// Of three pairs from `pair` on.
vec3 squared_differences(int offset, uint pair) {
    vec3 others = vec3(value[offset + wide_difference(step_of(pair))], value[offset + wide_difference(step_of(pair + 1u))],
                       value[offset + wide_difference(step_of(pair + 2u))]);
    vec3 difference = others - value[offset];
    return difference * difference;
}

void main() {
    uint offset = invocation_index();
    if (offset >= wide_count()) return;
    const uint reach = uint(octahedron_radius);
    if (!within(wide_voxel(offset), uvec3(reach + uint(patch_radius), reach, reach))) return;
    vec3 first = vec3(0.0), last = vec3(0.0);
    for (int t = -patch_radius; t <= patch_radius; ++t) {
        float weight = patch_window[abs(t)];
        first += weight * squared_differences(int(offset) + t, 0u);
        last += weight * squared_differences(int(offset) + t, 3u);
    }
    leave(offset, first, last);
}
