// Law W = mu/2 (J^(-2/3) tr C - 3) + kappa/2 (J - 1)².
// Needs: volume.quadratic; numbers, element, material and isochoric where stress is used (define USES_SHEAR 1).
// Gives: stress (kPa) of the isochoric part and of a pressure, NaN where J <= 0.
//! define USES_SHEAR

#if USES_SHEAR
Stress stress(uint e, Deformation d, Parameters p, float pressure) {
    if (!(d.volume_change > -1.0)) return not_a_stress();
    return first_invariant_stress(d, 0.5 * p.a.x, isochoric_factor(d), pressure);
}
#endif
