// Law W = mu/2 (tr C - 3) - mu ln J + lambda/2 (ln J)².
// Needs: numbers; element, material and isochoric where stress is used (define USES_SHEAR 1).
// Gives: stress (kPa) of the part with mu and of a pressure, and volumetric_derivative, U'(J) of U = (ln J)²/2. NaN where J <= 0: the
// energy is infinite there.
//! define USES_SHEAR

#if USES_SHEAR
/// P = mu (F - F⁻ᵀ) + pressure cof F.
Stress stress(uint e, Deformation d, Parameters p, float pressure) {
    return stretch_difference(d, p.a.x, d.volume_change > -1.0 ? pressure : not_a_number());
}
#endif

/// U'(J) = ln J / J from J - 1.
float volumetric_derivative(float volume_change) { return log_one_plus(volume_change) * reciprocal(1.0 + volume_change); }
