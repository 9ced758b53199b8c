// Law W = sum mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) + kappa/2 (J - 1)² of the isochoric principal
// stretches l = J^(-1/3) lambda (Ogden 1972).
// Needs: volume.quadratic; numbers, element, material and isochoric where stress is used (define USES_SHEAR 1).
// Gives: stress (kPa) of the isochoric part and of a pressure, NaN where J <= 0.
//! define USES_SHEAR

#if USES_SHEAR
/// Rotation that clears the entry pq of a symmetric matrix with the diagonal entries pp and qq; rp and rq are its entries
/// in the third row, np and nq the columns of the eigenvectors.
void jacobi_rotation(inout float pp, inout float qq, inout float pq, inout float rp, inout float rq, inout vec3 np,
                     inout vec3 nq) {
    float gap = qq - pp;
    float twice = 2.0 * pq;
    float root = sqrt(gap * gap + twice * twice) + 1e-30;
    float t = twice / (gap + (gap < 0.0 ? -root : root));
    float c = inversesqrt(t * t + 1.0);
    float s = t * c;
    pp = pp - t * pq;
    qq = qq + t * pq;
    pq = 0.0;
    float old_rp = rp;
    rp = c * old_rp - s * rq;
    rq = s * old_rp + c * rq;
    vec3 old_np = np;
    np = c * old_np - s * nq;
    nq = s * old_np + c * nq;
}

/// Adds mu (y - mean y), y = l^alpha - 1, to the principal Kirchhoff stresses.
vec3 ogden_term(float modulus, float exponent, vec3 log_stretch) {
    vec3 power = exponent * log_stretch;
    vec3 y = vec3(exp_minus_one(power.x), exp_minus_one(power.y), exp_minus_one(power.z));
    return modulus * (y - vec3((y.x + y.y + y.z) * (1.0 / 3.0)));
}

/// S = sum T_i / c_i n_i n_iᵀ, P = F S + pressure cof F; c_i = 1 + the eigenvalues of C - I, by cyclic Jacobi rotations.
Stress stress(uint e, Deformation d, Parameters p, float pressure) {
    if (!(d.volume_change > -1.0)) return not_a_stress();
    float xx = d.E.diagonal.x, yy = d.E.diagonal.y, zz = d.E.diagonal.z;
    float xy = d.E.others.x, yz = d.E.others.y, zx = d.E.others.z;
    vec3 n0 = vec3(1.0, 0.0, 0.0), n1 = vec3(0.0, 1.0, 0.0), n2 = vec3(0.0, 0.0, 1.0);
    for (int sweep = 0; sweep < 4; ++sweep) {
        jacobi_rotation(xx, yy, xy, zx, yz, n0, n1);
        jacobi_rotation(xx, zz, zx, xy, yz, n0, n2);
        jacobi_rotation(yy, zz, yz, xy, zx, n1, n2);
    }
    vec3 value = vec3(xx, yy, zz);
    vec3 log_stretch = 0.5 * vec3(log_one_plus(value.x), log_one_plus(value.y), log_one_plus(value.z)) -
                       vec3(log_one_plus(d.volume_change) * (1.0 / 3.0));
    vec3 T = ogden_term(p.a.x, p.a.y, log_stretch);
    if (p.a.z != 0.0) T += ogden_term(p.a.z, p.a.w, log_stretch);
    if (p.b.x != 0.0) T += ogden_term(p.b.x, p.b.y, log_stretch);
    vec3 S = T / (1.0 + value);
    return Stress((mat3(1.0) + d.H) *
                      (S.x * outerProduct(n0, n0) + S.y * outerProduct(n1, n1) + S.z * outerProduct(n2, n2)) +
                  pressure * cofactor_F(d));
}
#endif
