// Law W = mu/2 (I1 - 3) + eta/2 (I4 - 1)² + kappa/2 (J - 1)², I4 = J^(-2/3) a·C a.
// Needs: volume.quadratic; numbers, element, material and isochoric where stress is used (define USES_SHEAR 1), and fibre_of(e)
// and with_fibre, which may come later.
// Gives: stress (kPa) of the isochoric part and of a pressure, NaN where J <= 0.
//! define USES_SHEAR

#if USES_SHEAR
/// a, unit vector.
vec3 fibre_of(uint e);
/// Adds c f aᵀ with f = F a.
Stress with_fibre(Deformation d, Stress stress, float c, vec3 a);

/// P of the neo-Hookean part and 2 eta (I4 - 1) j (f aᵀ - (a·C a)/3 F⁻ᵀ) with f = F a, whose second term joins the pressure.
Stress stress(uint e, Deformation d, Parameters p, float pressure) {
    vec3 a = fibre_of(e);
    float excess = dot(d.E.diagonal, a * a) + 2.0 * dot(d.E.others, a * a.yzx);  // a·C a - 1
    float J = 1.0 + d.volume_change;
    float j = J > 0.0 ? isochoric_factor(d) : not_a_number();
    float sum = 1.0 + j + j * j;
    float inverse_J = reciprocal(J);
    // With j³ = J⁻², 1 - j = (1 - j³)/(1 + j + j²) keeps small strains.
    float less = d.volume_change * (1.0 + J) * (inverse_J * inverse_J) * reciprocal(sum);  // 1 - j
    float strength = excess - less * (1.0 + excess);                                       // I4 - 1
    float third = (1.0 + excess) * (1.0 / 3.0) * inverse_J;
    float c = 2.0 * p.a.y * strength * j;
    return with_fibre(d, first_invariant_stress(d, 0.5 * p.a.x, j, pressure - c * third), c, a);
}
#endif
