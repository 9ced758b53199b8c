// Needs: bindings.
// Gives: fibre_of(e), unit vector of an element, and fibre_stress as a first Piola-Kirchhoff stress.

layout(std430, binding = BINDING_FIBRE) readonly buffer Fibre { vec4 fibre[]; };

vec3 fibre_of(uint e) { return fibre[e].xyz; }
mat3 fibre_stress(vec3 a, vec3 f) { return outerProduct(f, a); }
