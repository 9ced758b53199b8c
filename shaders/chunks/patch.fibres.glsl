// Tissue of patches with fibres and without viscosity. Needs: bindings, patch.tissue, patch.fibre.
// Gives: tissue_at, take_tissue.

layout(std430, binding = BINDING_PATCH_TISSUE) readonly buffer PatchTissue { uint patch_fibre[]; };

uvec4 tissue_at(uint at) { return uvec4(0u, 0u, 0u, patch_fibre[at]); }
void take_tissue(uvec4 tissue) { fibre_in_hand = tissue.w; }
