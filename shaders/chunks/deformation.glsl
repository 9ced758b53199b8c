// Gives: deformation(H), what laws and pressures take of the displacement gradient H = F - I of any element, so that float32
// keeps the digits of small strains.

mat3 cofactor(mat3 A) { return mat3(cross(A[1], A[2]), cross(A[2], A[0]), cross(A[0], A[1])); }

float trace(mat3 A) { return A[0][0] + A[1][1] + A[2][2]; }

struct Deformation {
    mat3 H;               // displacement gradient
    mat3 cofactor_F;      // J F⁻ᵀ
    mat3 J_I_minus_cofactor_F;  // = J (I - F⁻ᵀ), without the cancellation of its two terms
    float trace_H;
    float volume_change;  // J - 1
};

/// With I₂ = ½ (tr² H - tr H²) = tr cof H: cof F = (1 + tr H) I - Hᵀ + cof H and J - 1 = tr H + I₂ + det H.
Deformation deformation(mat3 H) {
    mat3 cofactor_H = cofactor(H);
    mat3 H_transposed = transpose(H);
    float trace_H = trace(H);
    float higher = trace(cofactor_H) + dot(H[0], cofactor_H[0]);
    Deformation d;
    d.H = H;
    d.cofactor_F = mat3(1.0 + trace_H) - H_transposed + cofactor_H;
    d.J_I_minus_cofactor_F = mat3(higher) + H_transposed - cofactor_H;
    d.trace_H = trace_H;
    d.volume_change = trace_H + higher;
    return d;
}
