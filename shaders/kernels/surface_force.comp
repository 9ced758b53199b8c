// One invocation per node that surface effects move: writes their force on it (mN). Reads displacements alone, so it may run
// beside the element passes.
// Needs: index, bindings, surface, the chunks surface.* of the effects whose flags are 1.
//! define HAS_PRESSURE
//! define HAS_MEMBRANE
//! define HAS_SLIDING
//! define HAS_PARTING

layout(std430, binding = BINDING_SURFACE_FORCE) writeonly buffer SurfaceForce { vec4 surface_force_of_node[]; };

void main() {
    uint s = invocation_index();
    if (s >= surface_node_count) return;
    uint a = surface_effects[s];
    vec3 u = displacement[a].xyz;
    vec3 force = vec3(0.0);
#if HAS_PRESSURE
    force += pressure_force(s, u);
#endif
#if HAS_MEMBRANE
    force += membrane_force(s, u);
#endif
#if HAS_SLIDING
    force += sliding_force(s, u);
#endif
#if HAS_PARTING
    force += parting_force(s, u);
#endif
    surface_force_of_node[a] = vec4(force, 0.0);
}
