// Needs: bindings, deformation, isochoric.first.
// Gives: fibre_of(e), unit vector of an element, and with_fibre.

layout(std430, binding = BINDING_FIBRE) readonly buffer Fibre { vec4 fibre[]; };

vec3 fibre_of(uint e) { return fibre[e].xyz; }

Stress with_fibre(Deformation d, Stress stress, float c, vec3 a) {
    return Stress(stress.P + c * outerProduct(a + d.H * a, a));
}
