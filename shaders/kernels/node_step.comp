// One invocation per node, the time step in increment form: v⁺ = momentum v + gain r / m, u⁺ = u + v⁺ with v = u - u⁻.
// A constrained component has inverse mass and increment zero and keeps its displacement.
// Needs: index, bindings, node, the effects' chunks, node.residual. The element_force pass has run.
// STORES_RESIDUAL 1 leaves the residual that the step used, zero where constrained.
//! define STORES_RESIDUAL
//! define HAS_CONTACT

layout(location = 1) uniform float momentum;
layout(location = 2) uniform float gain;

layout(std430, binding = BINDING_DISPLACEMENT) buffer Displacement { vec4 displacement[]; };
layout(std430, binding = BINDING_INCREMENT) buffer Increment { vec4 increment[]; };
layout(std430, binding = BINDING_INVERSE_MASS) readonly buffer InverseMass { vec4 inverse_mass[]; };
#if STORES_RESIDUAL
layout(std430, binding = BINDING_RESIDUAL) writeonly buffer Residual { vec4 residual_of_node[]; };
#endif

void main() {
    uint a = invocation_index();
    if (a >= node_count) return;
    vec3 u = displacement[a].xyz;
    vec3 weight = inverse_mass[a].xyz;
    vec3 residual = nodal_residual(a, u);
    vec3 v = momentum * increment[a].xyz + gain * (residual * weight);
    u += v;
#if HAS_CONTACT
    settle(a, equal(weight, vec3(0.0)), u, v);
#endif
    displacement[a] = vec4(u, 0.0);
    increment[a] = vec4(v, 0.0);
#if STORES_RESIDUAL
    residual_of_node[a] = vec4(mix(residual, vec3(0.0), equal(weight, vec3(0.0))), 0.0);
#endif
}
