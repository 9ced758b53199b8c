// One invocation per voxel of the wide grid: 1 where all voxels within DESCRIPTOR_REACH along an axis are.
// Needs: index, match.
//! define DESCRIPTOR_REACH

layout(location = 0) uniform uint axis;

layout(std430, binding = BINDING_MATCH_SOURCE) readonly buffer MatchMaskSource { uint source[]; };
layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchMaskTarget { uint target[]; };

void main() {
    uint offset = invocation_index();
    if (offset >= wide_count()) return;
    uvec3 voxel = wide_voxel(offset);
    uint result = 0u;
    if (voxel[axis] >= DESCRIPTOR_REACH && voxel[axis] + DESCRIPTOR_REACH < wide_size[axis]) {
        uint stride = wide_stride()[axis];
        result = 1u;
        uint at = offset - DESCRIPTOR_REACH * stride;
        for (uint t = 0u; t <= 2u * DESCRIPTOR_REACH; ++t, at += stride) result &= source[at];
    }
    target[offset] = result;
}
