// Law W = mu/2 (J^(-2/3) tr C - 3) + kappa/2 (J - 1)².
// Needs: numbers; element where shear_stress is used (define USES_SHEAR 1).
// Gives: shear_stress, the first Piola-Kirchhoff stress of the isochoric part (kPa), NaN where J <= 0; and
// volumetric_derivative, U'(J) of U = (J - 1)²/2.
//! define USES_SHEAR

#if USES_SHEAR
/// P = mu J^(-2/3) (F - (tr C)/3 F⁻ᵀ); with tr C = 3 + 2 tr H + H:H the bracket is
/// H + [(J I - cof F) - (2 tr H + H:H)/3 cof F] / J.
mat3 shear_stress(Deformation d, float shear_modulus) {
    float J = 1.0 + d.volume_change;
    if (!(J > 0.0)) return mat3(not_a_number());
    float H_H = dot(d.H[0], d.H[0]) + dot(d.H[1], d.H[1]) + dot(d.H[2], d.H[2]);
    float third = (2.0 * d.trace_H + H_H) * (1.0 / 3.0);
    mat3 bracket = d.H + (d.J_I_minus_cofactor_F - third * d.cofactor_F) * (1.0 / J);
    return (shear_modulus * pow(J, -2.0 / 3.0)) * bracket;
}
#endif

/// U'(J) = J - 1.
float volumetric_derivative(float volume_change) { return volume_change; }
