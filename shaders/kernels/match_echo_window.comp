// One invocation per shift and brick: windows of all sums along an axis.
// Needs: index, match, match.echo, match.echo.linear or match.echo.structure.

layout(location = 2) uniform uint axis;

layout(std430, binding = BINDING_ECHO_SOURCE) readonly buffer EchoSource { float source[]; };
layout(std430, binding = BINDING_ECHO_TARGET) writeonly buffer EchoTarget { float target[]; };

void main() {
    uint index = invocation_index();
    if (index >= sum_stride()) return;
    ivec2 window = window_of(index % brick_total(), axis);
    int stride = brick_stride(axis), offset = int(index);
    for (int s = 0; s < sum_count; ++s, offset += int(sum_stride())) {
        float sum = 0.0;
        for (int d = window.x; d <= window.y; ++d) sum += brick_weight[d + window_radius] * source[offset + d * stride];
        target[offset] = sum;
    }
}
