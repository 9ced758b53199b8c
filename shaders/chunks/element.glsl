// Needs: bindings, deformation. Uniforms 0 and 1 are the range of elements of the dispatch, uniform 2 the number of all elements.
// Gives: rest data and kinematics of the linear tetrahedron in terms of the displacement gradient H = F - I, so that
// float32 keeps the digits of small strains.

layout(location = 0) uniform uint first_element;
layout(location = 1) uniform uint end_element;
layout(location = 2) uniform uint element_count;

layout(std430, binding = BINDING_DISPLACEMENT) readonly buffer Displacement { vec4 displacement[]; };
layout(std430, binding = BINDING_ELEMENT_NODES) readonly buffer ElementNodes { uvec4 element_nodes[]; };
/// Three planes of element_count entries: (gradient of N1, volume), (gradient of N2, material), (gradient of N3,
/// volumetric modulus); 1/mm, mm³, index of the scene's materials, kPa.
layout(std430, binding = BINDING_ELEMENT_REST) readonly buffer ElementRest { vec4 element_rest[]; };

struct RestElement {
    vec3 gradient_1, gradient_2, gradient_3;  // of the shape functions; the first node's is minus their sum
    float volume;
    float material;
    float volumetric_modulus;  // of the part that the element evaluates itself
};

RestElement rest_element(uint e) {
    vec4 a = element_rest[e];
    vec4 b = element_rest[element_count + e];
    vec4 c = element_rest[2u * element_count + e];
    return RestElement(a.xyz, b.xyz, c.xyz, a.w, b.w, c.w);
}

/// H = Σ (u_k - u_0) ⊗ grad N_k.
mat3 displacement_gradient(uint e, RestElement rest) {
    uvec4 n = element_nodes[e];
    vec3 u0 = displacement[n.x].xyz;
    return outerProduct(displacement[n.y].xyz - u0, rest.gradient_1) +
           outerProduct(displacement[n.z].xyz - u0, rest.gradient_2) +
           outerProduct(displacement[n.w].xyz - u0, rest.gradient_3);
}
