// Law W = mu/2 (I1 - 3) + eta/2 (I4 - 1)² + kappa/2 (J - 1)², I4 = J^(-2/3) a·C a.
// Needs: volume.quadratic; numbers, element, material and isochoric where stress is used (define USES_SHEAR 1).
// Gives: stress (kPa) of the isochoric part and of a pressure, NaN where J <= 0.
//! define USES_SHEAR

#if USES_SHEAR
/// a, unit vector of every element.
layout(std430, binding = BINDING_FIBRE) readonly buffer Fibre { vec4 fibre[]; };

/// P of the neo-Hookean part and 2 eta (I4 - 1) j (f aᵀ - (a·C a)/3 F⁻ᵀ) with f = F a.
mat3 stress(uint e, Deformation d, Parameters p, float pressure) {
    if (!(d.volume_change > -1.0)) return mat3(not_a_number());
    vec3 a = fibre[e].xyz;
    vec3 stretch = d.H * a;
    float excess = 2.0 * dot(a, stretch) + dot(stretch, stretch);  // a·C a - 1
    float j_minus_1 = exp_minus_one(-2.0 / 3.0 * log_one_plus(d.volume_change));
    float strength = j_minus_1 * (1.0 + excess) + excess;  // I4 - 1
    float third = (1.0 + excess) * (1.0 / 3.0) / (1.0 + d.volume_change);
    mat3 bracket = outerProduct(a + stretch, a) - third * cofactor_F(d);
    float j = 1.0 + j_minus_1;
    return first_invariant_stress(d, 0.5 * p.a.x, j, pressure) + (2.0 * p.a.y * strength * j) * bracket;
}
#endif
