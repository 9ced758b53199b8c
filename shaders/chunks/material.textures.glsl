// Needs: texels.
// Gives: what chunk material gives, out of a texture of two texels for each material.

layout(binding = UNIT_MATERIAL_PARAMETERS) uniform sampler2D material_parameters;

struct Parameters {
    vec4 a, b;
};

vec4 material_parameter(int index) {
    int width = textureSize(material_parameters, 0).x;
    return texelFetch(material_parameters, ivec2(index % width, index / width), 0);
}

Parameters parameters_of(uint material) {
    int index = 2 * int(material);
    return Parameters(material_parameter(index), material_parameter(index + 1));
}
