// Needs: numbers, deformation.
// Gives: Stress, kept as a first Piola-Kirchhoff stress P, which every law has.

struct Stress {
    mat3 P;
};

Stress not_a_stress() { return Stress(mat3(not_a_number())); }
mat3 first_piola_kirchhoff(Deformation d, Stress stress) { return stress.P; }

/// c (F - F⁻ᵀ) + q cof F = cof F (c/J E + q I), since F - F⁻ᵀ = F⁻ᵀ (FᵀF - I). In a turned body the terms of F - F⁻ᵀ are of
/// the order of 1 and cancel; what rounding left of them had moments, which turned the body (docs/decisions/
/// gpu_arithmetic.md). E is small and symmetric from the start.
Stress stretch_difference(Deformation d, float c, float q) {
    float factor = c * reciprocal(1.0 + d.volume_change);
    vec3 a = factor * d.E.diagonal + vec3(q);
    vec3 b = factor * d.E.others;
    return Stress(cofactor_F(d) * mat3(a.x, b.x, b.z, b.x, a.y, b.y, b.z, b.y, a.z));
}
