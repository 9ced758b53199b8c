// Needs: isochoric.second, patch.tissue.
// Gives: fibre_of, unit vector of the tetrahedron in hand, once fetch_fibre has been called, and with_fibre.

vec2 fibre_in_hand;

void fetch_fibre() { fibre_in_hand = patch_tissue[place]; }

/// The half z >= 0 of an octahedron |x| + |y| + z = 1, blown up to the sphere: a fibre has no sense.
vec3 fibre_of(uint e) {
    vec2 p = fibre_in_hand;
    vec3 a = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    return a * inversesqrt(dot(a, a));
}

/// F⁻¹ f aᵀ = a aᵀ.
Stress with_fibre(Deformation d, Stress S, float c, vec3 a) {
    return Stress(S.diagonal + c * (a * a), S.others + c * (a * a.yzx));
}
