// Needs: bindings.
// Gives: fibre_of(e), unit vector of an element.

layout(std430, binding = BINDING_FIBRE) readonly buffer Fibre { vec4 fibre[]; };

vec3 fibre_of(uint e) { return fibre[e].xyz; }
