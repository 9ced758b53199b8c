// Law W = mu'/2 (tr C - 3) + lambda'/2 (J - alpha)² - mu'/2 ln(tr C + 1) (Smith, de Goes, Kim 2018): finite for J <= 0.
// Needs: volume.quadratic; numbers, element, material and isochoric where stress is used (define USES_SHEAR 1).
// Gives: stress (kPa) of the part beside (lambda' - mu'/4)/2 (J - 1)² and of a pressure.
//! define USES_SHEAR

#if USES_SHEAR
/// P = mu' (1 - 1/(tr C + 1)) F + mu' ((J - 1)/4 - 3/4) cof F; with tr C + 1 = 4 + x the factor of F is 3/4 + x / (4 (4 + x)).
/// With cof F = (1 + tr H) I - Q the terms of F - cof F that cancel are left out.
Stress stress(uint e, Deformation d, Parameters p, float pressure) {
    float x = trace_excess(d);
    float y = x / (4.0 * (4.0 + x));
    float mu = p.a.x;
    pressure += 0.25 * mu * d.volume_change;
    float of_I = mu * (y - 0.75 * d.trace_H) + pressure * (1.0 + d.trace_H);
    return Stress(mat3(of_I) + (mu * (0.75 + y)) * d.H + (0.75 * mu - pressure) * d.Q);
}
#endif
