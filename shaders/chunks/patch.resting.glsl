// Effect: viscous stresses of a Prony series (chunk viscosity) over patches, in a step in which they rest. Needs: viscosity,
// patch.stresses. Gives: rested_stress, P of what the law gives less F times the sum of the terms' stresses of the tetrahedron in
// hand; fetch_viscous_stress comes before it.
//! define LAW_GIVES_SECOND

/// Bits of (11 22), (33 23) and (13 12) in half precision, kPa.
vec2 diagonal_in_hand;
float others_in_hand;

void fetch_viscous_stress() {
    diagonal_in_hand = patch_tissue[first_resting() + place];
    others_in_hand = patch_tissue[first_resting() + places + place / 2u][place % 2u];
}

SecondStress resting_stress() {
    vec2 a = unpackHalf2x16(floatBitsToUint(diagonal_in_hand.x)), b = unpackHalf2x16(floatBitsToUint(diagonal_in_hand.y));
    return SecondStress(vec3(a, b.x), vec3(b.y, unpackHalf2x16(floatBitsToUint(others_in_hand))));
}

#if LAW_GIVES_SECOND
mat3 rested_stress(Deformation d, Stress S) {
    SecondStress q = resting_stress();
    return first_piola_kirchhoff(d, Stress(S.diagonal - q.diagonal, S.others - q.others.zxy));
}
#else
mat3 rested_stress(Deformation d, Stress stress) { return stress.P - first_stress(d, resting_stress()); }
#endif
