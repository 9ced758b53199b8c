// Needs: patch.tissue.
// Gives: fibre_of, unit vector of the tetrahedron in hand, once fetch_fibre has been called, and fibre_stress: where LAW_GIVES_SECOND is
// 1, F⁻¹ f aᵀ.
//! define LAW_GIVES_SECOND

vec2 fibre_in_hand;

void fetch_fibre() { fibre_in_hand = patch_tissue[place]; }

/// The half z >= 0 of an octahedron |x| + |y| + z = 1, blown up to the sphere: a fibre has no sense.
vec3 fibre_of(uint e) {
    vec2 p = fibre_in_hand;
    vec3 a = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    return a * inversesqrt(dot(a, a));
}

mat3 fibre_stress(vec3 a, vec3 f) { return outerProduct(LAW_GIVES_SECOND == 1 ? a : f, a); }
