// Effect: viscous stresses of a Prony series (chunk viscosity) over patches, in a step that moves them on. Needs: bindings, viscosity,
// patch.tissue, patch.fibre where HAS_FIBRES is 1.
// Gives: tissue_at, take_tissue; moved_stress, P of the tetrahedron in hand (kPa) less F sum q⁺, which keeps q⁺. A patch that computes its forces
// again in a step finds its stresses advanced: advance_stresses, hold_stresses.
//! define PRONY_TERMS
//! define HAS_FIBRES
//! define LAW_GIVES_SECOND

/// Two entries of each place as patch.resting reads them, then three planes of all places for each term, (11 22), (33 23) and
/// (13 12), kPa, then (a, b) of each material's terms. No other invocation reads or writes a place within a dispatch.
layout(std430, binding = BINDING_PATCH_TISSUE) buffer PatchTissue { vec2 patch_tissue[]; };

/// (a, b) of each term. Terms that a material lacks have a = b = 0.
vec2 prony[PRONY_TERMS];
vec2 stress_in_hand[3u * PRONY_TERMS];

uint place_in_plane(uint i) { return (2u + i) * places + place; }

void advance_stresses(uint material) {
    uint first = (2u + 3u * PRONY_TERMS) * places + material * PRONY_TERMS;
    for (uint term = 0u; term < PRONY_TERMS; ++term) prony[term] = patch_tissue[first + term];
}

void hold_stresses() {
    for (uint term = 0u; term < PRONY_TERMS; ++term) prony[term] = vec2(0.0, 1.0);
}

/// Nothing stays but the fibre, which lies beside what moves.
uvec4 tissue_at(uint at) { return uvec4(0u); }
void take_tissue(uvec4 tissue) {
    for (uint i = 0u; i < 3u * PRONY_TERMS; ++i) stress_in_hand[i] = patch_tissue[place_in_plane(i)];
#if HAS_FIBRES
    fibre_in_hand = floatBitsToUint(patch_tissue[2u * place + 1u].y);
#endif
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
        patch_tissue[place_in_plane(i)] = a;
        patch_tissue[place_in_plane(i + 1u)] = b;
        patch_tissue[place_in_plane(i + 2u)] = c;
        sum_a += a;
        sum_b += b;
        sum_c += c;
    }
    return SecondStress(vec3(sum_a, sum_b.x), vec3(sum_b.y, sum_c));
}

/// From what the law gives of the shear part, and the pressure.
#if LAW_GIVES_SECOND
mat3 moved_stress(Deformation d, mat3 S, float pressure) {
    mat3 q = full(viscous_stress(SecondStress(vec3(S[0][0], S[1][1], S[2][2]), vec3(S[1][2], S[0][2], S[0][1]))));
    mat3 total = S - q + stretch_difference(d, 0.0, pressure);
    return total + d.H * total;
}
#else
mat3 moved_stress(Deformation d, mat3 P, float pressure) {
    mat3 viscous = first_stress(d, viscous_stress(second_stress(d, P)));  // not in `P -= …`: README, traps
    return P - viscous + pressure * cofactor_F(d);
}
#endif
