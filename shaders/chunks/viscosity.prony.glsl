// Effect: viscous stresses of a Prony series (chunk viscosity), kept for elements. Needs: bindings, element, viscosity.
// Gives: viscous_stress_of, F sum q⁺ (kPa). ADVANCES_TIME 1 keeps q⁺. Terms that a material lacks have a = b = 0.
//! define PRONY_TERMS
//! define ADVANCES_TIME

/// (a, b) of PRONY_TERMS terms for each material.
layout(std430, binding = BINDING_PRONY) readonly buffer Prony { vec2 prony[]; };
/// Two planes of element_count entries for each term: (11 22 33 23) and (13 12 - -), kPa.
layout(std430, binding = BINDING_VISCOUS_STRESS) buffer ViscousStress { vec4 viscous_stress[]; };

mat3 viscous_stress_of(uint e, uint material, Deformation d, mat3 P) {
    SecondStress S = second_stress(d, P);
    vec4 S_a = vec4(S.diagonal, S.others.x);
    vec4 S_b = vec4(S.others.yz, 0.0, 0.0);
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
    return first_stress(d, SecondStress(sum_a.xyz, vec3(sum_a.w, sum_b.xy)));
}
