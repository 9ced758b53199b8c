// Law W = sum mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) + kappa/2 (J - 1)² of the isochoric principal
// stretches l = J^(-1/3) lambda (Ogden 1972).
// Needs: volume.quadratic; numbers, element, material and isochoric where shear_stress is used (define USES_SHEAR 1).
// Gives: shear_stress (kPa) of the isochoric part, NaN where J <= 0.
//! define USES_SHEAR

#if USES_SHEAR
/// Rotation that clears A[p][q], applied to A and to the columns of n; r is the third index.
void jacobi_rotation(inout mat3 A, inout mat3 n, int p, int q, int r) {
    float gap = A[q][q] - A[p][p];
    float twice = 2.0 * A[p][q];
    float root = sqrt(gap * gap + twice * twice) + 1e-37;
    float t = twice / (gap + (gap < 0.0 ? -root : root));
    float c = inversesqrt(t * t + 1.0);
    float s = t * c;
    A[p][p] -= t * A[p][q];
    A[q][q] += t * A[p][q];
    A[p][q] = A[q][p] = 0.0;
    float rp = A[r][p];
    float rq = A[r][q];
    A[r][p] = A[p][r] = c * rp - s * rq;
    A[r][q] = A[q][r] = s * rp + c * rq;
    vec3 np = n[p];
    n[p] = c * np - s * n[q];
    n[q] = s * np + c * n[q];
}

/// Adds mu (y - mean y), y = l^alpha - 1, to the principal Kirchhoff stresses.
vec3 ogden_term(float modulus, float exponent, vec3 log_stretch) {
    vec3 power = exponent * log_stretch;
    vec3 y = vec3(exp_minus_one(power.x), exp_minus_one(power.y), exp_minus_one(power.z));
    return modulus * (y - vec3((y.x + y.y + y.z) * (1.0 / 3.0)));
}

/// S = sum T_i / c_i n_i n_iᵀ, P = F S; c_i = 1 + the eigenvalues of C - I, by cyclic Jacobi rotations.
mat3 shear_stress(uint e, Deformation d, Parameters p) {
    if (!(d.volume_change > -1.0)) return mat3(not_a_number());
    mat3 E = strain_excess(d);
    mat3 n = mat3(1.0);
    for (int sweep = 0; sweep < 4; ++sweep) {
        jacobi_rotation(E, n, 0, 1, 2);
        jacobi_rotation(E, n, 0, 2, 1);
        jacobi_rotation(E, n, 1, 2, 0);
    }
    vec3 value = vec3(E[0][0], E[1][1], E[2][2]);
    vec3 log_stretch = 0.5 * vec3(log_one_plus(value.x), log_one_plus(value.y), log_one_plus(value.z)) -
                       vec3(log_one_plus(d.volume_change) * (1.0 / 3.0));
    vec3 T = ogden_term(p.a.x, p.a.y, log_stretch);
    if (p.a.z != 0.0) T += ogden_term(p.a.z, p.a.w, log_stretch);
    if (p.b.x != 0.0) T += ogden_term(p.b.x, p.b.y, log_stretch);
    vec3 S = T / (1.0 + value);
    return (mat3(1.0) + d.H) *
           (S.x * outerProduct(n[0], n[0]) + S.y * outerProduct(n[1], n[1]) + S.z * outerProduct(n[2], n[2]));
}
#endif
