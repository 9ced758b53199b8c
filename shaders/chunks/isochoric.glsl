// Needs: numbers, deformation.
// Gives: what the laws of the isochoric invariants share. Precondition of all: J > 0.

/// J^(-2/3).
float isochoric_factor(Deformation d) { return pow(1.0 + d.volume_change, -2.0 / 3.0); }

/// tr C - 3 = 2 tr H + H:H.
float trace_excess(Deformation d) {
    return 2.0 * d.trace_H + dot(d.H[0], d.H[0]) + dot(d.H[1], d.H[1]) + dot(d.H[2], d.H[2]);
}

/// c (F - F⁻ᵀ) + q cof F with F - F⁻ᵀ = (J H + (J I - cof F)) / J. The quotient is one factor of the whole: the rounding
/// error of 1 / J on one of the terms alone would be a stress whose moments do not balance, which turns a rotating body
/// faster or slower.
StressFactors stretch_difference(Deformation d, float c, float q) {
    float J = 1.0 + d.volume_change;
    float factor = c * reciprocal(J);
    return StressFactors(factor * J, factor, q);
}

/// psi_1 times the derivative of J^(-2/3) tr C, and pressure cof F: 2 psi_1 j (F - (tr C)/3 F⁻ᵀ); with tr C = 3 + x the
/// bracket is F - F⁻ᵀ - x/3 cof F / J.
StressFactors first_invariant_stress(Deformation d, float psi_1, float j, float pressure) {
    float c = 2.0 * psi_1 * j;
    float third = trace_excess(d) * (1.0 / 3.0) / (1.0 + d.volume_change);
    return stretch_difference(d, c, pressure - c * third);
}

/// C - I = H + Hᵀ + Hᵀ H.
mat3 strain_excess(Deformation d) {
    mat3 H_transposed = transpose(d.H);
    return d.H + H_transposed + H_transposed * d.H;
}
