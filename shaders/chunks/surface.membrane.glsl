// Effect: thin incompressible neo-Hookean sheets. Needs: surface. Uniform 2 is the place of their lists.
// Gives: membrane_force(s, u), mN: what P = mu F (I - C⁻¹/det C) leaves on the node's corner. With F = Q + G, where Q are two
// axes of the face at rest and G the displacement gradient, C - I = Qᵀ G + Gᵀ Q + Gᵀ G loses no digits of small strains.

layout(location = 2) uniform uint membrane_lists;

const uint membrane_record = 12u;  // nodes b, c; mu times volume, mN mm; (D⁻¹)₀₀, (D⁻¹)₀₁, (D⁻¹)₁₁, 1/mm; columns of Q

/// I - C⁻¹/det C for C = I + A: with d = det C - 1 = tr A + det A it is ((d (2 + d) - tr A) I + A) / (1 + d)².
mat2 membrane_bracket(float A_00, float A_01, float A_11) {
    float trace_A = A_00 + A_11;
    float determinant = A_00 * A_11 - A_01 * A_01;
    float d = trace_A + determinant;
    float on_diagonal = trace_A + 2.0 * determinant + d * d;
    float inverse = 1.0 / ((1.0 + d) * (1.0 + d));
    return inverse * mat2(on_diagonal + A_00, A_01, A_01, on_diagonal + A_11);
}

vec3 membrane_force(uint s, vec3 u) {
    vec3 sum = vec3(0.0);
    uint end = surface_effects[membrane_lists + s + 1u];
    for (uint at = surface_effects[membrane_lists + s]; at < end; at += membrane_record) {
        vec3 to_rest = surface_vector(at + 3u);
        vec3 Q_0 = surface_vector(at + 6u);
        vec3 Q_1 = surface_vector(at + 9u);
        vec3 moved_b = moved_beyond(at, u);
        vec3 G_0 = to_rest.x * moved_b;
        vec3 G_1 = to_rest.y * moved_b + to_rest.z * moved_beyond(at + 1u, u);
        mat2 bracket = membrane_bracket(2.0 * dot(Q_0, G_0) + dot(G_0, G_0),
                                        dot(Q_0, G_1) + dot(G_0, Q_1) + dot(G_0, G_1),
                                        2.0 * dot(Q_1, G_1) + dot(G_1, G_1));
        // D⁻ᵀ (1, 1), because the node's corner takes minus the forces of the other two.
        vec2 weight = bracket * vec2(to_rest.x, to_rest.y + to_rest.z);
        sum += surface_number(at + 2u) * (weight.x * (Q_0 + G_0) + weight.y * (Q_1 + G_1));
    }
    return sum;
}
