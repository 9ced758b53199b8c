// Law W = mu/2 (I1 - 3) + eta/2 (I4 - 1)² + kappa/2 (J - 1)², I4 = J^(-2/3) a·C a.
// Needs: volume.quadratic; numbers, element, material and isochoric where stress is used (define USES_SHEAR 1), and fibre_of(e)
// and fibre_stress(a, f), which may come later.
// Gives: stress (kPa) of the isochoric part and of a pressure, NaN where J <= 0.
//! define USES_SHEAR

#if USES_SHEAR
/// a, unit vector.
vec3 fibre_of(uint e);
/// f aᵀ with f = F a.
mat3 fibre_stress(vec3 a, vec3 f);

/// P of the neo-Hookean part and 2 eta (I4 - 1) j (f aᵀ - (a·C a)/3 F⁻ᵀ) with f = F a, whose second term joins the pressure.
mat3 stress(uint e, Deformation d, Parameters p, float pressure) {
    vec3 a = fibre_of(e);
    vec3 stretch = d.H * a;
    float excess = 2.0 * dot(a, stretch) + dot(stretch, stretch);  // a·C a - 1
    float J = 1.0 + d.volume_change;
    float j = J > 0.0 ? isochoric_factor(d) : not_a_number();
    float sum = 1.0 + j + j * j;
    float inverse = reciprocal(J * J * sum);
    // With j³ = J⁻², 1 - j = (1 - j³)/(1 + j + j²) keeps small strains.
    float strength = excess - d.volume_change * (1.0 + J) * inverse * (1.0 + excess);  // I4 - 1
    float third = (1.0 + excess) * (1.0 / 3.0) * (inverse * J * sum);
    float c = 2.0 * p.a.y * strength * j;
    return first_invariant_stress(d, 0.5 * p.a.x, j, pressure - c * third) + c * fibre_stress(a, a + stretch);
}
#endif
