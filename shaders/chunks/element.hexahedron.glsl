// Needs: bindings, deformation. Uniforms 0 and 1 are the range of hexahedra of the dispatch, uniform 2 the number of all
// hexahedra, uniform 3 the number of tetrahedra, which come first in buffers of both (element.glsl).
// Gives: rest data and kinematics of the one-point hexahedron (tled/hex_state.hpp) in terms of H = F - I, and its hourglass
// displacements. In place of element: kernels that need rest_element and displacement_gradient alone take either.

layout(location = 0) uniform uint first_element;
layout(location = 1) uniform uint end_element;
layout(location = 2) uniform uint element_count;
layout(location = 3) uniform uint tetrahedron_count;

layout(std430, binding = BINDING_DISPLACEMENT) readonly buffer Displacement { vec4 displacement[]; };
/// Behind the tetrahedra two planes of element_count entries: the corners 0 to 3 and 4 to 7.
layout(std430, binding = BINDING_ELEMENT_NODES) readonly buffer ElementNodes { uvec4 element_nodes[]; };
/// Behind the three planes of tetrahedra ten of element_count entries: seven gradients of N1 to N7 (1/mm) with volume,
/// material, volumetric modulus and hourglass stiffness beside the first four (mm³, index, kPa, mN/mm), then the rows of
/// XG, mm.
layout(std430, binding = BINDING_ELEMENT_REST) readonly buffer ElementRest { vec4 element_rest[]; };

struct RestElement {
    vec3 gradient[7];  // mean gradients of N1 to N7; that of N0 is minus their sum
    float volume;
    float material;
    float volumetric_modulus;
    float hourglass_stiffness;
    vec4 rest_hourglass[3];  // row j: sum over corners of G_a X_j for the four base vectors G_a
};

RestElement rest_element(uint e) {
    uint first = 3u * tetrahedron_count + e;
    RestElement rest;
    vec4 planes[7];
    for (uint k = 0u; k < 7u; ++k) {
        planes[k] = element_rest[first + k * element_count];
        rest.gradient[k] = planes[k].xyz;
    }
    rest.volume = planes[0].w;
    rest.material = planes[1].w;
    rest.volumetric_modulus = planes[2].w;
    rest.hourglass_stiffness = planes[3].w;
    for (uint j = 0u; j < 3u; ++j) rest.rest_hourglass[j] = element_rest[first + (7u + j) * element_count];
    return rest;
}

/// u_k - u_0 of the corners 1 to 7, mm.
struct Motion {
    vec3 corner[7];
};

Motion motion(uint e) {
    uvec4 bottom = element_nodes[tetrahedron_count + e];
    uvec4 top = element_nodes[tetrahedron_count + element_count + e];
    vec3 u0 = displacement[bottom.x].xyz;
    return Motion(vec3[7](displacement[bottom.y].xyz - u0, displacement[bottom.z].xyz - u0,
                          displacement[bottom.w].xyz - u0, displacement[top.x].xyz - u0, displacement[top.y].xyz - u0,
                          displacement[top.z].xyz - u0, displacement[top.w].xyz - u0));
}

mat3 displacement_gradient(Motion m, RestElement rest) {
    mat3 H = outerProduct(m.corner[0], rest.gradient[0]);
    for (uint k = 1u; k < 7u; ++k) H += outerProduct(m.corner[k], rest.gradient[k]);
    return H;
}

mat3 displacement_gradient(uint e, RestElement rest) { return displacement_gradient(motion(e), rest); }

/// The four base vectors at the corners 1 to 7: products yz, zx, xy and xyz of the corner's signs.
const vec4 hourglass_base[7] = vec4[7](vec4(1.0, -1.0, -1.0, 1.0), vec4(-1.0, -1.0, 1.0, -1.0),
                                       vec4(-1.0, 1.0, -1.0, 1.0), vec4(-1.0, -1.0, 1.0, 1.0),
                                       vec4(-1.0, 1.0, -1.0, -1.0), vec4(1.0, 1.0, 1.0, 1.0),
                                       vec4(1.0, -1.0, -1.0, -1.0));

/// q_a = sum of G_a (u - u_0) - H XG_a: row i is component i of the four, mm.
mat3x4 hourglass_displacements(Motion m, mat3 H, RestElement rest) {
    mat3x4 q = mat3x4(0.0);
    for (uint k = 0u; k < 7u; ++k)
        for (uint i = 0u; i < 3u; ++i) q[i] += m.corner[k][i] * hourglass_base[k];
    for (uint i = 0u; i < 3u; ++i)
        for (uint j = 0u; j < 3u; ++j) q[i] -= H[j][i] * rest.rest_hourglass[j];
    return q;
}
