// Law W = mu sum C_i / lambda_m^(2i-2) (I1^i - 3^i) + kappa/2 ((J² - 1)/2 - ln J) (Arruda and Boyce 1993), I1
// isochoric.
// Needs: numbers, element, material and isochoric where stress is used (define USES_SHEAR 1).
// Gives: stress (kPa) of the isochoric part and of a pressure, NaN where J <= 0; and volumetric_derivative, U'(J) of
// U = ((J² - 1)/2 - ln J)/2.
//! define USES_SHEAR

#if USES_SHEAR
Stress stress(uint e, Deformation d, Parameters p, float pressure) {
    if (!(d.volume_change > -1.0)) return not_a_stress();
    float j = isochoric_factor(d);
    float I1 = j * (3.0 + trace_excess(d));
    float psi_1 = p.a.x + I1 * (p.a.y + I1 * (p.a.z + I1 * (p.a.w + I1 * p.b.x)));
    return first_invariant_stress(d, psi_1, j, pressure);
}
#endif

/// U'(J) = (J - 1/J)/2 from J - 1, NaN for J <= 0.
float volumetric_derivative(float volume_change) {
    float J = 1.0 + volume_change;
    return J > 0.0 ? volume_change * (1.0 + J) / (2.0 * J) : not_a_number();
}
