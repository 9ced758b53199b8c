// Squared differences of neighbours as far apart as two patches, where both are seen, over every second row of the grid:
// one partial sum and count per workgroup, in a fixed order.
// Needs: index, match, match.octahedron. To be dispatched with PARTIALS workgroups in one row.
//! define PARTIALS

layout(std430, binding = BINDING_MATCH_VALUE) readonly buffer MatchValue { float value[]; };
layout(std430, binding = BINDING_MATCH_SEEN) readonly buffer MatchSeen { uint seen[]; };
layout(std430, binding = BINDING_MATCH_PARTIAL) writeonly buffer MatchPartial { vec2 partial[]; };

shared vec2 lane[WORKGROUP_SIZE];

/// Sum and count of a voxel.
vec2 of_voxel(uint offset) {
    vec2 sum = vec2(0.0);
    if (seen[offset] == 0u) return sum;
    for (uint pair = 0u; pair < 6u; ++pair) {
        uint other = uint(int(offset) + wide_difference(step_of(pair)));
        float difference = value[other] - value[offset];
        if (seen[other] != 0u) sum += vec2(difference * difference, 1.0);
    }
    return sum;
}

void main() {
    uint local = gl_LocalInvocationID.x;
    uvec3 size = grid_size();
    uvec2 rows = (size.yz + 1u) / 2u;
    vec2 sum = vec2(0.0);
    for (uint n = gl_WorkGroupID.x * WORKGROUP_SIZE + local; n < size.x * rows.x * rows.y; n += PARTIALS * WORKGROUP_SIZE) {
        uint row = n / size.x;
        uvec3 voxel = uvec3(n - row * size.x, 2u * (row % rows.x), 2u * (row / rows.x)) + uint(match_rim);
        sum += of_voxel(voxel.x * wide_stride().x + voxel.y * wide_stride().y + voxel.z * wide_stride().z);
    }
    lane[local] = sum;
    barrier();
    for (uint half_size = WORKGROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
        if (local < half_size) lane[local] += lane[local + half_size];
        barrier();
    }
    if (local == 0u) partial[gl_WorkGroupID.x] = lane[0];
}
