// Law W = mu'/2 (tr C - 3) + lambda'/2 (J - alpha)² - mu'/2 ln(tr C + 1) (Smith, de Goes, Kim 2018): finite for J <= 0.
// Needs: volume.quadratic; numbers, element, material and isochoric where shear_stress is used (define USES_SHEAR 1).
// Gives: shear_stress (kPa) of the part beside lambda'/2 (J - 1)².
//! define USES_SHEAR

#if USES_SHEAR
/// P = mu' (1 - 1/(tr C + 1)) F - 3/4 mu' cof F; with tr C + 1 = 4 + x the factor of F is 3/4 + x / (4 (4 + x)).
/// F - cof F = H + (J I - cof F) - (J - 1) I.
mat3 shear_stress(uint e, Deformation d, Parameters p) {
    float x = trace_excess(d);
    mat3 difference = d.H + d.J_I_minus_cofactor_F - mat3(d.volume_change);
    return p.a.x * (0.75 * difference + (x / (4.0 * (4.0 + x))) * (mat3(1.0) + d.H));
}
#endif
