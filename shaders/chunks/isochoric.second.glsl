// Needs: numbers, deformation, isochoric.
// Gives: stretch_difference as a second Piola-Kirchhoff stress S = F⁻¹ P, which viscous stresses are of: laws that make their stress of
// it alone then give S.

/// b (E - cof E) + i I. With A = cof C, C A = J² I gives I - C⁻¹ = (J² I - A)/J²; A = (1 + tr E) I - (E - cof E).
mat3 second_of(StrainExcess E, float b, float i) {
    vec3 a = E.diagonal;
    vec3 o = E.others;  // xy yz zx
    vec3 diagonal = b * (a - a.yzx * a.zxy + o.yzx * o.yzx) + vec3(i);
    vec3 others = b * (o - o.yzx * o.zxy + o * a.zxy);
    return mat3(diagonal.x, others.x, others.z, others.x, diagonal.y, others.y, others.z, others.y, diagonal.z);
}

/// c (I - C⁻¹) + q cof C / J.
mat3 stretch_difference(Deformation d, float c, float q) {
    StrainExcess E = symmetric_strain(d);
    float t = E.diagonal.x + E.diagonal.y + E.diagonal.z;
    float inverse = reciprocal(1.0 + d.volume_change);
    float c_2 = c * (inverse * inverse);
    float q_1 = q * inverse;
    float k = d.volume_change * (2.0 + d.volume_change) - t;  // J² - 1 - t
    return second_of(E, c_2 - q_1, c_2 * k + q_1 * (1.0 + t));
}
