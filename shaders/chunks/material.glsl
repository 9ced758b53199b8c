// Needs: bindings.
// Gives: the constants of a law for the materials of the scene: eight numbers each, in the order of
// tled/material/kernel_parameters.hpp (kPa and exponents).

layout(std430, binding = BINDING_MATERIAL_PARAMETERS) readonly buffer MaterialParameters {
    vec4 material_parameters[];
};

struct Parameters {
    vec4 a, b;
};

Parameters parameters_of(uint material) {
    return Parameters(material_parameters[2u * material], material_parameters[2u * material + 1u]);
}
