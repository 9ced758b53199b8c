// Needs: numbers, element.
// Gives: what the laws of the isochoric invariants share. Precondition of all: J > 0.

/// J^(-2/3).
float isochoric_factor(Deformation d) { return pow(1.0 + d.volume_change, -2.0 / 3.0); }

/// tr C - 3 = 2 tr H + H:H.
float trace_excess(Deformation d) {
    return 2.0 * d.trace_H + dot(d.H[0], d.H[0]) + dot(d.H[1], d.H[1]) + dot(d.H[2], d.H[2]);
}

/// F - F⁻ᵀ = (J H + (J I - cof F)) / J. The quotient is one factor of the whole: its rounding error on one of the terms
/// alone would be a stress whose moments do not balance, which turns a rotating body faster or slower.
mat3 stretch_difference(Deformation d) {
    float J = 1.0 + d.volume_change;
    return (J * d.H + d.J_I_minus_cofactor_F) * reciprocal(J);
}

/// psi_1 times the derivative of J^(-2/3) tr C: 2 psi_1 j (F - (tr C)/3 F⁻ᵀ); with tr C = 3 + x the bracket is
/// F - F⁻ᵀ - x/3 cof F / J.
mat3 first_invariant_stress(Deformation d, float psi_1, float j) {
    float third = trace_excess(d) * (1.0 / 3.0) / (1.0 + d.volume_change);
    return (2.0 * psi_1 * j) * (stretch_difference(d) - third * d.cofactor_F);
}

/// C - I = H + Hᵀ + Hᵀ H.
mat3 strain_excess(Deformation d) {
    mat3 H_transposed = transpose(d.H);
    return d.H + H_transposed + H_transposed * d.H;
}
