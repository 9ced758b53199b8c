// Effect: viscous stresses of a Prony series, S = S_elastic - sum q with q⁺ = a S_shear + b q at the end of the time step
// (backward Euler). Needs: numbers, deformation.
// Gives: the symmetric second Piola-Kirchhoff stress of a first one, and back.

struct SecondStress {
    vec3 diagonal, others;  // 11 22 33, 23 13 12
};

mat3 full(SecondStress S) {
    vec3 a = S.diagonal;
    vec3 b = S.others;
    return mat3(a.x, b.z, b.y, b.z, a.y, b.x, b.y, b.x, a.z);
}

/// S = F⁻¹ P = (cof F)ᵀ P / J.
SecondStress second_stress(Deformation d, mat3 P) {
    mat3 C = cofactor_F(d);
    float inverse_J = 1.0 / (1.0 + d.volume_change);
    return SecondStress(inverse_J * vec3(dot(C[0], P[0]), dot(C[1], P[1]), dot(C[2], P[2])),
                        inverse_J * vec3(dot(C[1], P[2]), dot(C[0], P[2]), dot(C[0], P[1])));
}

/// F S.
mat3 first_stress(Deformation d, SecondStress S) {
    mat3 whole = full(S);
    return mat3(multiply_add(d.H, whole[0], whole[0]), multiply_add(d.H, whole[1], whole[1]),
                multiply_add(d.H, whole[2], whole[2]));
}
