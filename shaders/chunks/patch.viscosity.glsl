// Effect: viscous stresses of a Prony series (chunk viscosity) over patches. Needs: viscosity, patch.stresses, patch.stresses.*.
// Gives: relaxed_stress, P of the tetrahedron in hand (kPa) less F sum q⁺, which keeps q⁺; fetch_viscous_stress comes before it. A patch
// that computes its forces again in a step finds its stresses advanced: advance_stresses, hold_stresses.
//! define HAS_FIBRES
//! define LAW_GIVES_SECOND

/// (a, b) of each term. Terms that a material lacks have a = b = 0.
vec2 prony[PRONY_TERMS];
/// q of each term, kPa: (11 22) (33 23) (13 12).
vec2 stress_in_hand[3u * PRONY_TERMS];

void advance_stresses(uint material) {
    uint first = first_coefficient() + material * PRONY_TERMS;
    for (uint term = 0u; term < PRONY_TERMS; ++term) prony[term] = patch_tissue[first + term];
}

void hold_stresses() {
    for (uint term = 0u; term < PRONY_TERMS; ++term) prony[term] = vec2(0.0, 1.0);
}

void fetch_viscous_stress() {
    for (uint i = 0u; i < 3u * PRONY_TERMS; ++i) stress_in_hand[i] = kept_stress(i);
}

/// Sum q⁺ of q⁺ = a S + b q.
SecondStress viscous_stress(SecondStress S) {
    vec2 sum_a = vec2(0.0);
    vec2 sum_b = vec2(0.0);
    vec2 sum_c = vec2(0.0);
    for (uint term = 0u; term < PRONY_TERMS; ++term) {
        uint i = 3u * term;
        vec2 factor = prony[term];
        vec2 a = factor.x * S.diagonal.xy + factor.y * stress_in_hand[i];
        vec2 b = factor.x * vec2(S.diagonal.z, S.others.x) + factor.y * stress_in_hand[i + 1u];
        vec2 c = factor.x * S.others.yz + factor.y * stress_in_hand[i + 2u];
        keep_stress(i, a);
        keep_stress(i + 1u, b);
        keep_stress(i + 2u, c);
        sum_a += a;
        sum_b += b;
        sum_c += c;
    }
    return SecondStress(vec3(sum_a, sum_b.x), vec3(sum_b.y, sum_c));
}

/// From what the law gives of the shear part, and the pressure.
#if LAW_GIVES_SECOND
mat3 relaxed_stress(Deformation d, Stress S, float pressure) {
    SecondStress q = viscous_stress(SecondStress(S.diagonal, S.others.yzx));
    Stress volumetric = stretch_difference(d, 0.0, pressure);
    return first_piola_kirchhoff(d, Stress(S.diagonal - q.diagonal + volumetric.diagonal,
                                           S.others - q.others.zxy + volumetric.others));
}
#else
mat3 relaxed_stress(Deformation d, Stress stress, float pressure) {
    mat3 viscous = first_stress(d, viscous_stress(second_stress(d, stress.P)));  // not in `P -= …`: README, traps
    return stress.P - viscous + pressure * cofactor_F(d);
}
#endif
