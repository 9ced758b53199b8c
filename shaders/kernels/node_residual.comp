// One invocation per node: writes f_ext + f_spring - f_int (mN). MASKS_CONSTRAINED 1 writes zero where constrained.
// Needs: index, bindings, node, the effects' chunks, node.residual. The element_force pass has run.
//! define MASKS_CONSTRAINED

layout(std430, binding = BINDING_DISPLACEMENT) readonly buffer Displacement { vec4 displacement[]; };
layout(std430, binding = BINDING_RESIDUAL) writeonly buffer Residual { vec4 residual_of_node[]; };
#if MASKS_CONSTRAINED
layout(std430, binding = BINDING_INVERSE_MASS) readonly buffer InverseMass { vec4 inverse_mass[]; };
#endif

void main() {
    uint a = invocation_index();
    if (a >= node_count) return;
    vec3 residual = nodal_residual(a, displacement[a].xyz);
#if MASKS_CONSTRAINED
    residual = mix(residual, vec3(0.0), equal(inverse_mass[a].xyz, vec3(0.0)));
#endif
    residual_of_node[a] = vec4(residual, 0.0);
}
