// Effect: viscous stresses of a Prony series (chunk viscosity) over patches, in a step in which they rest. Needs: bindings, viscosity,
// patch.tissue, patch.fibre where HAS_FIBRES is 1.
// Gives: tissue_at, take_tissue; rested_stress, P of what the law gives less F times the sum of the terms.
//! define HAS_FIBRES
//! define LAW_GIVES_SECOND

/// First of all that is kept of a place: the sum of the terms, bits of (11 22), (33 23) and (13 12) in half precision, kPa, and
/// the fibre.
layout(std430, binding = BINDING_PATCH_TISSUE) readonly buffer PatchTissue { uvec4 patch_resting[]; };

uvec3 resting_in_hand;

uvec4 tissue_at(uint at) { return patch_resting[at]; }
void take_tissue(uvec4 tissue) {
    resting_in_hand = tissue.xyz;
#if HAS_FIBRES
    fibre_in_hand = tissue.w;
#endif
}

SecondStress resting_stress() {
    vec2 a = unpackHalf2x16(resting_in_hand.x), b = unpackHalf2x16(resting_in_hand.y);
    return SecondStress(vec3(a, b.x), vec3(b.y, unpackHalf2x16(resting_in_hand.z)));
}

#if LAW_GIVES_SECOND
mat3 rested_stress(Deformation d, mat3 S) {
    mat3 total = S - full(resting_stress());
    return total + d.H * total;
}
#else
mat3 rested_stress(Deformation d, mat3 P) { return P - first_stress(d, resting_stress()); }
#endif
