// One invocation per voxel of a layer about the mesh: the mean displacement of those beside it that have one.
// Needs: index, match, match.field. The pass of the layer before has run.

layout(location = 0) uniform uint first;
layout(location = 1) uniform uint count;

/// A voxel's offset, and which of its neighbours -i, +i, -j, +j, -k, +k count, one bit each.
layout(std430, binding = BINDING_MATCH_GROWTH) readonly buffer MatchGrowth { uvec2 growth[]; };

void main() {
    uint n = invocation_index();
    if (n >= count) return;
    uvec2 entry = growth[first + n];
    uvec3 stride = wide_stride();
    vec3 sum = vec3(0.0);
    for (int axis = 0; axis < 3; ++axis) {
        if ((entry.y & (1u << (2 * axis))) != 0u) sum += field_at(entry.x - stride[axis]);
        if ((entry.y & (2u << (2 * axis))) != 0u) sum += field_at(entry.x + stride[axis]);
    }
    set_field(entry.x, sum / float(bitCount(entry.y)));
}
