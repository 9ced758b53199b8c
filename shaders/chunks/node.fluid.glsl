// Effect: lift of a fluid. Needs: bindings. Gives: fluid_force(a, u) = weight · clamp(½ + depth / column) up, mN.

/// Up, then of each node: ½ + its depth at rest over its column's height; 1 / height, 1/mm; weight of the fluid that it
/// displaces, mN.
layout(std430, binding = BINDING_FLUID) readonly buffer Fluid { vec4 fluid[]; };

vec3 fluid_force(uint a, vec3 u) {
    vec3 up = fluid[0].xyz;
    vec4 column = fluid[a + 1u];
    return (column.z * clamp(column.x - dot(up, u) * column.y, 0.0, 1.0)) * up;
}
