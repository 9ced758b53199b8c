// Needs: numbers, deformation.
// Gives: Stress, kept as a second Piola-Kirchhoff stress S = F⁻¹ P, of laws that make theirs of stretch_difference: six numbers in place
// of nine, and what viscous stresses are of.

/// xx yy zz and xy yz zx.
struct Stress {
    vec3 diagonal, others;
};

Stress not_a_stress() { return Stress(vec3(not_a_number()), vec3(not_a_number())); }

/// F S = S + H S.
mat3 first_piola_kirchhoff(Deformation d, Stress S) {
    vec3 a = S.diagonal;
    vec3 b = S.others;
    vec3 x = vec3(a.x, b.x, b.z), y = vec3(b.x, a.y, b.y), z = vec3(b.z, b.y, a.z);
    return mat3(multiply_add(d.H, x, x), multiply_add(d.H, y, y), multiply_add(d.H, z, z));
}

/// b (E - cof E) + i I.
Stress stress_of_strain(StrainExcess E, float b, float i) {
    vec3 a = E.diagonal;
    vec3 o = E.others;
    return Stress(b * (a - a.yzx * a.zxy + o.yzx * o.yzx) + vec3(i), b * (o - o.yzx * o.zxy + o * a.zxy));
}

/// c (I - C⁻¹) + q cof C / J. With A = cof C, C A = J² I gives I - C⁻¹ = (J² I - A)/J²; A = (1 + tr E) I - (E - cof E).
Stress stretch_difference(Deformation d, float c, float q) {
    float t = d.E.diagonal.x + d.E.diagonal.y + d.E.diagonal.z;
    float inverse = reciprocal(1.0 + d.volume_change);
    float c_2 = c * (inverse * inverse);
    float q_1 = q * inverse;
    float k = d.volume_change * (2.0 + d.volume_change) - t;  // J² - 1 - t
    return stress_of_strain(d.E, c_2 - q_1, c_2 * k + q_1 * (1.0 + t));
}
