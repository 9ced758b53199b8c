// Effect: viscous stresses of a Prony series, S = S_elastic - sum q with q⁺ = a S_shear + b q at the end of the time step
// (backward Euler). Needs: bindings, element.
// Gives: viscous_stress_of, F sum q⁺ (kPa). ADVANCES_TIME 1 keeps q⁺. Terms that a material lacks have a = b = 0.
//! define PRONY_TERMS
//! define ADVANCES_TIME

/// (a, b) of PRONY_TERMS terms for each material.
layout(std430, binding = BINDING_PRONY) readonly buffer Prony { vec2 prony[]; };
/// Two planes of element_count entries for each term: (11 22 33 12) and (23 13 - -), kPa.
layout(std430, binding = BINDING_VISCOUS_STRESS) buffer ViscousStress { vec4 viscous_stress[]; };

/// S = F⁻¹ P = (cof F)ᵀ P / J.
mat3 viscous_stress_of(uint e, uint material, Deformation d, mat3 P) {
    mat3 S = (1.0 / (1.0 + d.volume_change)) * (transpose(cofactor_F(d)) * P);
    vec4 S_a = vec4(S[0][0], S[1][1], S[2][2], S[1][0]);
    vec4 S_b = vec4(S[2][1], S[2][0], 0.0, 0.0);
    vec4 sum_a = vec4(0.0);
    vec4 sum_b = vec4(0.0);
    for (uint term = 0u; term < PRONY_TERMS; ++term) {
        vec2 factor = prony[material * PRONY_TERMS + term];
        uint place = 2u * term * element_count + e;
        vec4 q_a = factor.x * S_a + factor.y * viscous_stress[place];
        vec4 q_b = factor.x * S_b + factor.y * viscous_stress[place + element_count];
#if ADVANCES_TIME
        viscous_stress[place] = q_a;
        viscous_stress[place + element_count] = q_b;
#endif
        sum_a += q_a;
        sum_b += q_b;
    }
    mat3 q = mat3(sum_a.x, sum_a.w, sum_b.y, sum_a.w, sum_a.y, sum_b.x, sum_b.y, sum_b.x, sum_a.z);
    return q + d.H * q;
}
