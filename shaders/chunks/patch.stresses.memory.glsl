// Needs: patch.tissue.
// Gives: kept_stress, keep_stress: plane i of the viscous stresses of the tetrahedron in hand, in memory. No other invocation
// reads or writes them within a dispatch.
//! define PRONY_TERMS
//! define HAS_FIBRES

vec2 kept_stress(uint i) { return patch_tissue[(HAS_FIBRES + i) * places + place]; }
void keep_stress(uint i, vec2 q) { patch_tissue[(HAS_FIBRES + i) * places + place] = q; }
