// One workgroup: the mean squared difference of what match_difference left, merged in a fixed order.
// Needs: index, match. WORKGROUP_SIZE is the number of partial results.

layout(std430, binding = BINDING_MATCH_PARTIAL) readonly buffer MatchPartial { vec2 partial[]; };
layout(std430, binding = BINDING_MATCH_MEAN) writeonly buffer MatchMean { float mean_squared_difference; };

shared vec2 lane[WORKGROUP_SIZE];

void main() {
    uint local = gl_LocalInvocationID.x;
    lane[local] = partial[local];
    barrier();
    for (uint half_size = WORKGROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
        if (local < half_size) lane[local] += lane[local + half_size];
        barrier();
    }
    if (local == 0u) mean_squared_difference = lane[0].y > 0.0 ? lane[0].x / lane[0].y : 0.0;
}
