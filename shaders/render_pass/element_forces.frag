// First render pass (Taylor, Cheng, Ourselin 2008), one fragment per element: leaves its four corner forces
// f_k = V (P_mu + p cof F) grad N_k (mN) of the displacement in four textures. Texels behind the last element have no
// volume and leave zeros.
// Needs: numbers, texels, deformation, element.textures, material.textures, isochoric, a law with USES_SHEAR 1,
// pressure.element.

layout(location = 0) out vec4 corner_force_0;
layout(location = 1) out vec4 corner_force_1;
layout(location = 2) out vec4 corner_force_2;
layout(location = 3) out vec4 corner_force_3;

void main() {
    uint e = coordinates_of(ivec2(gl_FragCoord.xy));
    RestElement rest = rest_element(e);
    Deformation d = deformation(displacement_gradient(e, rest));
    float p = pressure_of_element(e, d.volume_change, rest.volumetric_modulus);
    mat3 P = first_piola_kirchhoff(d, stress(e, d, parameters_of(uint(rest.material)), p));
    mat3 scaled_stress = rest.volume * P;
    vec3 f1 = scaled_stress * rest.gradient_1;
    vec3 f2 = scaled_stress * rest.gradient_2;
    vec3 f3 = scaled_stress * rest.gradient_3;
    corner_force_0 = vec4(-(f1 + f2 + f3), 0.0);
    corner_force_1 = vec4(f1, 0.0);
    corner_force_2 = vec4(f2, 0.0);
    corner_force_3 = vec4(f3, 0.0);
}
