// Needs: numbers, deformation, isochoric.first or isochoric.second.
// Gives: what the laws of the isochoric invariants share. Precondition of all: J > 0.

/// J^(-2/3).
float isochoric_factor(Deformation d) { return pow(1.0 + d.volume_change, -2.0 / 3.0); }

/// tr C - 3.
float trace_excess(Deformation d) { return d.E.diagonal.x + d.E.diagonal.y + d.E.diagonal.z; }

/// psi_1 times the derivative of J^(-2/3) tr C, and pressure cof F: 2 psi_1 j (F - (tr C)/3 F⁻ᵀ); with tr C = 3 + x the
/// bracket is F - F⁻ᵀ - x/3 cof F / J.
Stress first_invariant_stress(Deformation d, float psi_1, float j, float pressure) {
    float c = 2.0 * psi_1 * j;
    float third = trace_excess(d) * (1.0 / 3.0) * reciprocal(1.0 + d.volume_change);
    return stretch_difference(d, c, pressure - c * third);
}
