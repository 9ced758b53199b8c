// One invocation per node: constrained components (inverse mass zero) take the imposed displacement and stop.
// Needs: index, bindings.

layout(location = 0) uniform uint node_count;

layout(std430, binding = BINDING_DISPLACEMENT) buffer Displacement { vec4 displacement[]; };
layout(std430, binding = BINDING_INCREMENT) buffer Increment { vec4 increment[]; };
layout(std430, binding = BINDING_INVERSE_MASS) readonly buffer InverseMass { vec4 inverse_mass[]; };
layout(std430, binding = BINDING_IMPOSED) readonly buffer Imposed { vec4 imposed[]; };

void main() {
    uint a = invocation_index();
    if (a >= node_count) return;
    bvec3 constrained = equal(inverse_mass[a].xyz, vec3(0.0));
    displacement[a] = vec4(mix(displacement[a].xyz, imposed[a].xyz, constrained), 0.0);
    increment[a] = vec4(mix(increment[a].xyz, vec3(0.0), constrained), 0.0);
}
