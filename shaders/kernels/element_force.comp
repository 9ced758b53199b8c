// One invocation per element: writes the four corner forces f_k = V (P_mu + p cof F) grad N_k (mN) of the displacement.
// Needs: index, bindings, numbers, element, material, isochoric, a law with USES_SHEAR 1, a pressure chunk; the viscosity
// chunk where HAS_VISCOSITY is 1.
//! define HAS_VISCOSITY

layout(std430, binding = BINDING_CORNER_FORCE) writeonly buffer CornerForce { vec4 corner_force[]; };

void main() {
    uint e = first_element + invocation_index();
    if (e >= end_element) return;
    RestElement rest = rest_element(e);
    Deformation d = deformation(displacement_gradient(e, rest));
    float p = pressure_of_element(e, d.volume_change, rest.volumetric_modulus);
    uint material = uint(rest.material);
#if HAS_VISCOSITY
    mat3 P = first_piola_kirchhoff(d, stress(e, d, parameters_of(material), 0.0));
    mat3 viscous_stress = viscous_stress_of(e, material, d, P);  // not in `P -= …`: README, traps
    P = P - viscous_stress + p * cofactor_F(d);
#else
    mat3 P = first_piola_kirchhoff(d, stress(e, d, parameters_of(material), p));
#endif
    mat3 scaled_stress = rest.volume * P;
    vec3 f1 = scaled_stress * rest.gradient_1;
    vec3 f2 = scaled_stress * rest.gradient_2;
    vec3 f3 = scaled_stress * rest.gradient_3;
    // Four planes of element_count entries, so that neighbouring invocations write neighbouring memory.
    corner_force[e] = vec4(-(f1 + f2 + f3), 0.0);
    corner_force[element_count + e] = vec4(f1, 0.0);
    corner_force[2u * element_count + e] = vec4(f2, 0.0);
    corner_force[3u * element_count + e] = vec4(f3, 0.0);
}
