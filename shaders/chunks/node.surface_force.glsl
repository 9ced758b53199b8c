// Effect: forces of the surface_force pass. Needs: bindings. Gives: surface_force(a), mN, zero where the surface effects move
// nothing. One vector for each node: an index would be one storage block more.

layout(std430, binding = BINDING_SURFACE_FORCE) readonly buffer SurfaceForce { vec4 surface_force_of_node[]; };

vec3 surface_force(uint a) { return surface_force_of_node[a].xyz; }
