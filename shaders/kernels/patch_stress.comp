// One invocation per place of the patches' tetrahedra: viscous stresses from those of elements, or back to them; SUMS 1: the sum
// of the terms, for steps in which it rests. Needs: index, bindings.
//! define PRONY_TERMS
//! define HAS_FIBRES
//! define LOADS
//! define SUMS

layout(location = 0) uniform uint element_count;

/// As chunks/viscosity.prony.glsl and chunks/patch.tissue.glsl have them.
layout(std430, binding = BINDING_VISCOUS_STRESS) buffer ViscousStress { vec4 viscous_stress[]; };
layout(std430, binding = BINDING_PATCH_TISSUE) buffer PatchTissue { vec2 patch_tissue[]; };
/// Of every place; 0xffffffff where a fan has none.
layout(std430, binding = BINDING_PATCH_ELEMENT) readonly buffer PatchElement { uint element_of_place[]; };

void main() {
    uint place = invocation_index();
    uint places = uint(element_of_place.length());
    if (place >= places) return;
    uint e = element_of_place[place];
    if (e == 0xffffffffu) return;
#if SUMS
    uint first = HAS_FIBRES * places + place, resting = (HAS_FIBRES + 3u * PRONY_TERMS) * places;
    float halves[3];
    for (uint i = 0u; i < 3u; ++i) {
        vec2 sum = vec2(0.0);
        for (uint term = 0u; term < PRONY_TERMS; ++term) sum += patch_tissue[first + (3u * term + i) * places];
        halves[i] = uintBitsToFloat(packHalf2x16(sum));
    }
    patch_tissue[resting + place] = vec2(halves[0], halves[1]);
    patch_tissue[resting + places + place / 2u][place % 2u] = halves[2];
#else
    for (uint term = 0u; term < PRONY_TERMS; ++term) {
        uint from = 2u * term * element_count + e;
        uint to = (HAS_FIBRES + 3u * term) * places + place;
#if LOADS
        vec4 a = viscous_stress[from];
        vec4 b = viscous_stress[from + element_count];
        patch_tissue[to] = a.xy;
        patch_tissue[to + places] = a.zw;
        patch_tissue[to + 2u * places] = b.xy;
#else
        viscous_stress[from] = vec4(patch_tissue[to], patch_tissue[to + places]);
        viscous_stress[from + element_count] = vec4(patch_tissue[to + 2u * places], 0.0, 0.0);
#endif
    }
#endif
}
