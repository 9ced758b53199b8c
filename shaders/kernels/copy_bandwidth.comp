// One invocation per vec4: copies it. What a device moves through its memory at most.
// Needs: index, bindings.

layout(location = 0) uniform uint count;

layout(std430, binding = BINDING_COPY_SOURCE) readonly buffer Source { vec4 source[]; };
layout(std430, binding = BINDING_COPY_TARGET) writeonly buffer Target { vec4 target[]; };

void main() {
    uint i = invocation_index();
    if (i < count) target[i] = source[i];
}
