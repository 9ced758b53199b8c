// One invocation per node: writes u - v, the displacement before the last step, mm.
// Needs: index, bindings.

layout(location = 0) uniform uint node_count;

layout(std430, binding = BINDING_DISPLACEMENT) readonly buffer Displacement { vec4 displacement[]; };
layout(std430, binding = BINDING_INCREMENT) readonly buffer Increment { vec4 increment[]; };
layout(std430, binding = BINDING_PREVIOUS_DISPLACEMENT) writeonly buffer PreviousDisplacement {
    vec4 previous_displacement[];
};

void main() {
    uint a = invocation_index();
    if (a >= node_count) return;
    previous_displacement[a] = vec4(displacement[a].xyz - increment[a].xyz, 0.0);
}
