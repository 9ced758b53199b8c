// Gives: deformation(H), what laws and pressures take of the displacement gradient H = F - I of any element, so that float32
// keeps the digits of small strains.

mat3 cofactor(mat3 A) { return mat3(cross(A[1], A[2]), cross(A[2], A[0]), cross(A[0], A[1])); }

float trace(mat3 A) { return A[0][0] + A[1][1] + A[2][2]; }

/// E = C - I = H + Hᵀ + Hᵀ H: xx yy zz and xy yz zx.
struct StrainExcess {
    vec3 diagonal, others;
};

StrainExcess strain_excess(mat3 H) {
    vec3 x = H[0], y = H[1], z = H[2];
    vec3 sums = vec3(y.x, z.y, x.z) + vec3(x.y, y.z, z.x);
    return StrainExcess(2.0 * vec3(x.x, y.y, z.z) + vec3(dot(x, x), dot(y, y), dot(z, z)),
                        sums + vec3(x.x, y.x, z.x) * vec3(y.x, z.x, x.x) + vec3(x.y, y.y, z.y) * vec3(y.y, z.y, x.y) +
                            vec3(x.z, y.z, z.z) * vec3(y.z, z.z, x.z));
}

struct Deformation {
    mat3 H;  // displacement gradient
    mat3 Q;  // Hᵀ - cof H
    StrainExcess E;
    float trace_H;
    float higher;         // J - 1 - tr H
    float volume_change;  // J - 1
};

/// With I₂ = ½ (tr² H - tr H²) = tr cof H: J - 1 = tr H + I₂ + det H.
Deformation deformation(mat3 H) {
    mat3 cofactor_H = cofactor(H);
    float trace_H = trace(H);
    float higher = trace(cofactor_H) + dot(H[0], cofactor_H[0]);
    return Deformation(H, transpose(H) - cofactor_H, strain_excess(H), trace_H, higher, trace_H + higher);
}

/// J F⁻ᵀ = (1 + tr H) I - Hᵀ + cof H.
mat3 cofactor_F(Deformation d) { return mat3(1.0 + d.trace_H) - d.Q; }
