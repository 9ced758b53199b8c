// Law W = mu/2 (tr C - 3) - mu ln J + lambda/2 (ln J)².
// Needs: numbers; element where shear_stress is used (define USES_SHEAR 1).
// Gives: shear_stress, the first Piola-Kirchhoff stress of the part with mu (kPa), and volumetric_derivative, U'(J) of
// U = (ln J)²/2. NaN where J <= 0: the energy is infinite there.
//! define USES_SHEAR

#if USES_SHEAR
/// P = mu (F - F⁻ᵀ) = mu (H + (J I - cof F) / J).
mat3 shear_stress(Deformation d, float shear_modulus) {
    float J = 1.0 + d.volume_change;
    if (!(J > 0.0)) return mat3(not_a_number());
    return shear_modulus * (d.H + d.J_I_minus_cofactor_F * (1.0 / J));
}
#endif

/// U'(J) = ln J / J from J - 1.
float volumetric_derivative(float volume_change) { return log_one_plus(volume_change) / (1.0 + volume_change); }
