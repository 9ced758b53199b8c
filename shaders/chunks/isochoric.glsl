// Needs: numbers, deformation.
// Gives: what the laws of the isochoric invariants share. Precondition of all: J > 0.

/// J^(-2/3).
float isochoric_factor(Deformation d) { return pow(1.0 + d.volume_change, -2.0 / 3.0); }

/// tr C - 3 = 2 tr H + H:H.
float trace_excess(Deformation d) {
    return 2.0 * d.trace_H + dot(d.H[0], d.H[0]) + dot(d.H[1], d.H[1]) + dot(d.H[2], d.H[2]);
}

/// E = C - I = H + Hᵀ + Hᵀ H: xx yy zz and xy yz zx.
struct StrainExcess {
    vec3 diagonal, others;
};

StrainExcess symmetric_strain(Deformation d) {
    vec3 x = d.H[0], y = d.H[1], z = d.H[2];
    return StrainExcess(2.0 * vec3(x.x, y.y, z.z) + vec3(dot(x, x), dot(y, y), dot(z, z)),
                        vec3(y.x, z.y, x.z) + vec3(x.y, y.z, z.x) + vec3(dot(x, y), dot(y, z), dot(z, x)));
}

mat3 strain_excess(Deformation d) {
    StrainExcess E = symmetric_strain(d);
    vec3 a = E.diagonal;
    vec3 b = E.others;
    return mat3(a.x, b.x, b.z, b.x, a.y, b.y, b.z, b.y, a.z);
}

/// c (F - F⁻ᵀ) + q cof F, which isochoric.first gives, or F⁻¹ of it, from isochoric.second.
mat3 stretch_difference(Deformation d, float c, float q);

/// psi_1 times the derivative of J^(-2/3) tr C, and pressure cof F: 2 psi_1 j (F - (tr C)/3 F⁻ᵀ); with tr C = 3 + x the
/// bracket is F - F⁻ᵀ - x/3 cof F / J.
mat3 first_invariant_stress(Deformation d, float psi_1, float j, float pressure) {
    float c = 2.0 * psi_1 * j;
    float third = trace_excess(d) * (1.0 / 3.0) / (1.0 + d.volume_change);
    return stretch_difference(d, c, pressure - c * third);
}
