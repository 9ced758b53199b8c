// Needs: texels, deformation. An element is named by the coordinates of its texel.
// Gives: what chunk element gives, out of textures.

layout(binding = UNIT_DISPLACEMENT) uniform sampler2D displacement;
layout(binding = UNIT_ELEMENT_NODES) uniform usampler2D element_nodes;  // coordinates of four nodes
layout(binding = UNIT_ELEMENT_REST_1) uniform sampler2D element_rest_1;  // gradient of N1 (1/mm), volume (mm³)
layout(binding = UNIT_ELEMENT_REST_2) uniform sampler2D element_rest_2;  // gradient of N2, index of the material
layout(binding = UNIT_ELEMENT_REST_3) uniform sampler2D element_rest_3;  // gradient of N3, volumetric modulus (kPa)

struct RestElement {
    vec3 gradient_1, gradient_2, gradient_3;  // of the shape functions; the first node's is minus their sum
    float volume;
    float material;
    float volumetric_modulus;
};

RestElement rest_element(uint e) {
    ivec2 texel = texel_of(e);
    vec4 a = texelFetch(element_rest_1, texel, 0);
    vec4 b = texelFetch(element_rest_2, texel, 0);
    vec4 c = texelFetch(element_rest_3, texel, 0);
    return RestElement(a.xyz, b.xyz, c.xyz, a.w, b.w, c.w);
}

vec3 displacement_of(uint node) { return texelFetch(displacement, texel_of(node), 0).xyz; }

/// H = Σ (u_k - u_0) ⊗ grad N_k.
mat3 displacement_gradient(uint e, RestElement rest) {
    uvec4 n = texelFetch(element_nodes, texel_of(e), 0);
    vec3 u0 = displacement_of(n.x);
    return outerProduct(displacement_of(n.y) - u0, rest.gradient_1) +
           outerProduct(displacement_of(n.z) - u0, rest.gradient_2) +
           outerProduct(displacement_of(n.w) - u0, rest.gradient_3);
}
