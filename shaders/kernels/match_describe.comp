// One invocation per voxel of the grid: its twelve channels of self-similarity context (Heinrich et al., MICCAI 2013),
// exp(-D/V) of the patch distances D less the smallest, in eight bits, four to a word; and whether they count.
// Needs: index, match, match.octahedron, match.distance.

layout(std430, binding = BINDING_MATCH_MEAN) readonly buffer MatchMean { float mean_squared_difference; };
layout(std430, binding = BINDING_MATCH_SEEN) readonly buffer MatchSeen { uint seen[]; };
layout(std430, binding = BINDING_MATCH_DESCRIPTORS) writeonly buffer MatchDescriptors { uint descriptor[]; };
layout(std430, binding = BINDING_MATCH_SHOWN) writeonly buffer MatchShown { uint shown[]; };

const float least_share = 1e-3, most_share = 1e3;  // of the mean squared difference: bounds of V

uint place(uint offset, uint pair, bool opposite) {
    return uint(int(offset) + wide_difference(shift_of(pair, opposite)));
}

/// Eight bits of each, the first lowest.
uint four_bytes(vec4 levels) {
    uvec4 bits = uvec4(255.0 * levels + 0.5);
    return bits.x | bits.y << 8 | bits.z << 16 | bits.w << 24;
}

void main() {
    uint n = invocation_index();
    uvec3 size = grid_size();
    if (n >= size.x * size.y * size.z) return;
    uint row = n / size.x;
    uvec3 voxel = uvec3(n - row * size.x, row % size.y, row / size.y) + uint(match_rim);
    uint offset = voxel.x + wide_size.x * (voxel.y + wide_size.y * voxel.z);
    vec4 a = vec4(distance_0[place(offset, 0u, false)], distance_0[place(offset, 0u, true)],
                  distance_1[place(offset, 1u, false)], distance_1[place(offset, 1u, true)]);
    vec4 b = vec4(distance_2[place(offset, 2u, false)], distance_2[place(offset, 2u, true)],
                  distance_3[place(offset, 3u, false)], distance_3[place(offset, 3u, true)]);
    vec4 c = vec4(distance_4[place(offset, 4u, false)], distance_4[place(offset, 4u, true)],
                  distance_5[place(offset, 5u, false)], distance_5[place(offset, 5u, true)]);
    vec4 lowest = min(a, min(b, c));
    float smallest = min(min(lowest.x, lowest.y), min(lowest.z, lowest.w));
    float mean = dot(a + b + c, vec4(1.0 / 12.0)), scale = max(mean_squared_difference, 1e-30);
    float variance = clamp(mean, least_share * scale, most_share * scale);
    descriptor[3u * n] = four_bytes(exp((smallest - a) / variance));
    descriptor[3u * n + 1u] = four_bytes(exp((smallest - b) / variance));
    descriptor[3u * n + 2u] = four_bytes(exp((smallest - c) / variance));
    shown[n] = seen[offset];
}
