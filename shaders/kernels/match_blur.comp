// One invocation per voxel of the fixed image: a Gaussian along an axis, cut at four standard deviations, of the image
// whose outermost voxels go on for ever.
// Needs: index, match.

layout(location = 0) uniform uint axis;
layout(location = 1) uniform float deviation;  // voxels

layout(std430, binding = BINDING_MATCH_SOURCE) readonly buffer MatchSource { float source[]; };
layout(std430, binding = BINDING_MATCH_TARGET) writeonly buffer MatchTarget { float target[]; };

void main() {
    uint offset = invocation_index(), row = offset / fixed_size.x;
    if (row >= fixed_size.y * fixed_size.z) return;
    uvec3 voxel = uvec3(offset - row * fixed_size.x, row % fixed_size.y, row / fixed_size.y);
    int stride = int(axis == 0u ? 1u : axis == 1u ? fixed_size.x : fixed_size.x * fixed_size.y);
    int at = int(voxel[axis]), last = int(fixed_size[axis]) - 1, reach = max(1, int(ceil(4.0 * deviation)));
    float sum = source[offset], weights = 1.0;
    for (int t = 1; t <= reach; ++t) {
        float weight = exp(-0.5 * float(t * t) / (deviation * deviation));
        int before = max(at - t, 0) - at, after = min(at + t, last) - at;
        sum += weight * (source[int(offset) + before * stride] + source[int(offset) + after * stride]);
        weights += 2.0 * weight;
    }
    target[offset] = sum / weights;
}
