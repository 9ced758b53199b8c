// One invocation per voxel of the wide grid: squared differences of a pair, smoothed along i.
// Needs: index, match, match.octahedron, match.patch.

layout(location = 0) uniform uint pair;

layout(std430, binding = BINDING_MATCH_VALUE) readonly buffer MatchValue { float value[]; };
layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchTarget { float target[]; };

float squared_difference(int offset, int away) {
    float difference = value[offset + away] - value[offset];
    return difference * difference;
}

void main() {
    uint offset = invocation_index();
    if (offset >= wide_count()) return;
    const uint reach = uint(octahedron_radius);
    if (!within(wide_voxel(offset), uvec3(reach + uint(patch_radius), reach, reach))) return;
    int away = wide_difference(step_of(pair));
    float sum = patch_window[0] * squared_difference(int(offset), away);
    for (int t = 1; t <= patch_radius; ++t)
        sum += patch_window[t] *
               (squared_difference(int(offset) - t, away) + squared_difference(int(offset) + t, away));
    target[offset] = sum;
}
