// One invocation per result: eight chains of multiply-adds, none of which waits for another. What a device computes at most.
// Each chain goes to its fixed point 1, so that numbers stay normal. A round is FMA_PER_ROUND multiply-adds.
// Needs: index, bindings.
//! define FMA_PER_ROUND

layout(location = 0) uniform uint count;
layout(location = 1) uniform uint rounds;

layout(std430, binding = BINDING_COPY_TARGET) writeonly buffer Result { float result[]; };

void main() {
    uint i = invocation_index();
    if (i >= count) return;
    float start = float(i & 1023u);
    vec4 a = start + vec4(0.0, 1.0, 2.0, 3.0);
    vec4 b = start + vec4(4.0, 5.0, 6.0, 7.0);
    const vec4 factor = vec4(0.75), rest = vec4(0.25);
    for (uint round = 0u; round < rounds; ++round)
        for (int k = 0; k < FMA_PER_ROUND / 8; ++k) {
            a = fma(a, factor, rest);
            b = fma(b, factor, rest);
        }
    a += b;
    result[i] = (a.x + a.y) + (a.z + a.w);
}
