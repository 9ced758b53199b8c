// One invocation per hexahedron: writes the eight corner forces f = (V P - k sum q_a XG_a) grad N + k sum G_a q_a (mN) of
// the displacement behind those of the tetrahedra.
// Needs: index, bindings, numbers, deformation, element.hexahedron, material, isochoric, a law with USES_SHEAR 1,
// pressure.element; the viscosity chunk where HAS_VISCOSITY is 1.
//! define HAS_VISCOSITY

layout(std430, binding = BINDING_CORNER_FORCE) writeonly buffer CornerForce { vec4 corner_force[]; };

void main() {
    uint e = first_element + invocation_index();
    if (e >= end_element) return;
    RestElement rest = rest_element(e);
    Motion m = motion(e);
    mat3 H = displacement_gradient(m, rest);
    Deformation d = deformation(H);
    uint material = uint(rest.material);
    float p = pressure_of_element(e, d.volume_change, rest.volumetric_modulus);
#if HAS_VISCOSITY
    mat3 P = first_piola_kirchhoff(d, stress(tetrahedron_count + e, d, parameters_of(material), 0.0));
    // Not in `P -= …`: README, traps.
    mat3 viscous_stress = viscous_stress_of(2u * PRONY_TERMS * tetrahedron_count + e, material, d, P);
    P = P - viscous_stress + p * cofactor_F(d);
#else
    mat3 P = first_piola_kirchhoff(d, stress(tetrahedron_count + e, d, parameters_of(material), p));
#endif
    mat3 scaled_stress = rest.volume * P;
    mat3x4 q = rest.hourglass_stiffness * hourglass_displacements(m, H, rest);
    for (uint i = 0u; i < 3u; ++i)
        for (uint j = 0u; j < 3u; ++j) scaled_stress[j][i] -= dot(q[i], rest.rest_hourglass[j]);
    // Eight planes of element_count entries.
    uint first = 4u * tetrahedron_count + e;
    vec3 sum = vec3(0.0);
    for (uint k = 0u; k < 7u; ++k) {
        vec3 f = scaled_stress * rest.gradient[k] + hourglass_base[k] * q;
        corner_force[first + (k + 1u) * element_count] = vec4(f, 0.0);
        sum += f;
    }
    corner_force[first] = vec4(-sum, 0.0);
}
