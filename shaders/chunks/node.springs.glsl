// Effect: springs to targets. Needs: bindings. Gives: spring_force(a, u) = K (target - u) of the node's summed spring, mN.

/// Words, floats by their bits: of each node the place of its spring, 0 where it has none; springs: K xx yy zz xy yz zx, mN/mm,
/// and K target, mN.
layout(std430, binding = BINDING_SPRINGS) readonly buffer Springs { uint springs[]; };

vec3 spring_vector(uint at) {
    return vec3(uintBitsToFloat(springs[at]), uintBitsToFloat(springs[at + 1u]), uintBitsToFloat(springs[at + 2u]));
}

vec3 spring_force(uint a, vec3 u) {
    uint spring = springs[a];
    if (spring == 0u) return vec3(0.0);
    vec3 diagonal = spring_vector(spring);
    vec3 others = spring_vector(spring + 3u);
    float xy = others.x;
    float yz = others.y;
    float zx = others.z;
    vec3 pull = spring_vector(spring + 6u);
    return pull - (diagonal * u + vec3(xy * u.y + zx * u.z, xy * u.x + yz * u.z, zx * u.x + yz * u.y));
}
