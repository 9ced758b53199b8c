// Law W = sum c_ij (I1 - 3)^i (I2 - 3)^j + kappa/2 (J - 1)² of the isochoric invariants: Mooney-Rivlin, Yeoh.
// Needs: volume.quadratic; numbers, element, material and isochoric where stress is used (define USES_SHEAR 1).
// Gives: stress (kPa) of the isochoric part and of a pressure, NaN where J <= 0.
//! define USES_SHEAR

#if USES_SHEAR
/// P = 2 psi_1 j (F - I1/3 F⁻ᵀ) + 2 psi_2 j² (I1 F - F C - 2/3 I2 F⁻ᵀ), j = J^(-2/3). With C = I + E, t = tr E and
/// q = 4/3 t + (t² - E:E)/3 the second bracket is 2 (F - F⁻ᵀ) + F (t I - E) - q F⁻ᵀ.
Stress stress(uint e, Deformation d, Parameters p, float pressure) {
    if (!(d.volume_change > -1.0)) return not_a_stress();
    vec3 a = d.E.diagonal, b = d.E.others;
    mat3 E = mat3(a.x, b.x, b.z, b.x, a.y, b.y, b.z, b.y, a.z);
    float t = trace(E);
    float minors = t * t - (dot(E[0], E[0]) + dot(E[1], E[1]) + dot(E[2], E[2]));
    float j = isochoric_factor(d);
    float x = j * (3.0 + t) - 3.0;
    float y = j * j * (3.0 + 2.0 * t + 0.5 * minors) - 3.0;
    float psi_1 = p.a.x + 2.0 * p.a.z * x + p.a.w * y + 3.0 * p.b.y * x * x;
    float psi_2 = p.a.y + p.a.w * x + 2.0 * p.b.x * y;
    float q = (4.0 / 3.0 * t + minors * (1.0 / 3.0)) / (1.0 + d.volume_change);
    mat3 second = stretch_difference(d, 2.0, -q).P + (mat3(1.0) + d.H) * (mat3(t) - E);
    return Stress(first_invariant_stress(d, psi_1, j, pressure).P + (2.0 * psi_2 * j * j) * second);
}
#endif
