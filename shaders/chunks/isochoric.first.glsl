// Needs: numbers, deformation, isochoric.
// Gives: stretch_difference as a first Piola-Kirchhoff stress.

/// c (F - F⁻ᵀ) + q cof F = cof F (c/J E + q I), since F - F⁻ᵀ = F⁻ᵀ (FᵀF - I). In a turned body the terms of F - F⁻ᵀ are of
/// the order of 1 and cancel; what rounding left of them had moments, which turned the body (docs/decisions/
/// gpu_arithmetic.md). E is small and symmetric from the start.
mat3 stretch_difference(Deformation d, float c, float q) {
    StrainExcess E = symmetric_strain(d);
    float factor = c * reciprocal(1.0 + d.volume_change);
    vec3 a = factor * E.diagonal + vec3(q);
    vec3 b = factor * E.others;
    return cofactor_F(d) * mat3(a.x, b.x, b.z, b.x, a.y, b.y, b.z, b.y, a.z);
}
