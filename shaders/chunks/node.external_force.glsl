// Effect: external forces. Needs: bindings. Gives: external_force(a), mN.

layout(std430, binding = BINDING_EXTERNAL_FORCE) readonly buffer ExternalForce { vec4 external_force_of_node[]; };

vec3 external_force(uint a) { return external_force_of_node[a].xyz; }
