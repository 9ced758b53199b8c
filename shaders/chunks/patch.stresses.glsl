// Needs: patch.tissue.
// Gives: where the planes of viscous stresses lie among those of patch_tissue: three for each term; their sum in half precision,
// as steps in which it rests read it, one plane and a half; the terms' coefficients.
//! define PRONY_TERMS
//! define HAS_FIBRES

uint first_resting() { return (HAS_FIBRES + 3u * PRONY_TERMS) * places; }
uint first_coefficient() { return first_resting() + places + (places + 1u) / 2u; }
