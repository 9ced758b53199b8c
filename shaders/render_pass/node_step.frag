// Second render pass (Taylor, Cheng, Ourselin 2008), one fragment per node: gathers the corner forces through two look-up
// textures, in their fixed order, and makes the step of kernels/node_step.comp in increment form,
// v⁺ = momentum v - gain f / m, u⁺ = u + v⁺ with v = u - u⁻. A constrained component has inverse mass and increment zero
// and keeps its displacement; so do texels behind the last node.
// Needs: texels. The element_forces pass has run.

layout(location = 0) uniform float momentum;
layout(location = 1) uniform float gain;

layout(binding = UNIT_DISPLACEMENT) uniform sampler2D displacement;
layout(binding = UNIT_INCREMENT) uniform sampler2D increment;
layout(binding = UNIT_INVERSE_MASS) uniform sampler2D inverse_mass;
/// NodeElCrds of the paper: coordinates of the node's first entry in force_coordinates, and its valence.
layout(binding = UNIT_NODE_ELEMENTS) uniform usampler2D node_elements;
/// FCrds of the paper, row by row: coordinates in the force textures, and which of the four in bits 30 and 31.
layout(binding = UNIT_FORCE_COORDINATES) uniform usampler2D force_coordinates;
layout(binding = UNIT_CORNER_FORCE_0) uniform sampler2D corner_force_0;
layout(binding = UNIT_CORNER_FORCE_1) uniform sampler2D corner_force_1;
layout(binding = UNIT_CORNER_FORCE_2) uniform sampler2D corner_force_2;
layout(binding = UNIT_CORNER_FORCE_3) uniform sampler2D corner_force_3;

layout(location = 0) out vec4 next_displacement;
layout(location = 1) out vec4 next_increment;

vec3 corner_force(uint coordinates) {
    ivec2 texel = texel_of(coordinates);
    switch (coordinates >> 30) {
        case 0u: return texelFetch(corner_force_0, texel, 0).xyz;
        case 1u: return texelFetch(corner_force_1, texel, 0).xyz;
        case 2u: return texelFetch(corner_force_2, texel, 0).xyz;
        default: return texelFetch(corner_force_3, texel, 0).xyz;
    }
}

vec3 gathered_force(ivec2 node) {
    uvec2 first_and_valence = texelFetch(node_elements, node, 0).xy;
    ivec2 at = texel_of(first_and_valence.x);
    int width = textureSize(force_coordinates, 0).x;
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < first_and_valence.y; ++i) {
        sum += corner_force(texelFetch(force_coordinates, at, 0).x);
        at = at.x + 1 < width ? ivec2(at.x + 1, at.y) : ivec2(0, at.y + 1);
    }
    return sum;
}

void main() {
    ivec2 node = ivec2(gl_FragCoord.xy);
    vec3 weight = texelFetch(inverse_mass, node, 0).xyz;
    vec3 v = momentum * texelFetch(increment, node, 0).xyz - gain * (gathered_force(node) * weight);
    next_displacement = vec4(texelFetch(displacement, node, 0).xyz + v, 0.0);
    next_increment = vec4(v, 0.0);
}
