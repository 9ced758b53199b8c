// Effect: springs to targets. Needs: bindings. Gives: spring_force(a, u) = K (target - u) of the node's summed spring, mN.

/// Spring of the node, or -1.
layout(std430, binding = BINDING_SPRING_INDEX) readonly buffer SpringIndex { int spring_index[]; };

struct NodalSpring {
    vec4 stiffness_a;  // K: xx yy zz xy, mN/mm
    vec4 stiffness_b;  // K: yz zx; K target: x y, mN
    vec4 force_z;      // K target: z
};
layout(std430, binding = BINDING_SPRINGS) readonly buffer Springs { NodalSpring springs[]; };

vec3 spring_force(uint a, vec3 u) {
    int s = spring_index[a];
    if (s < 0) return vec3(0.0);
    NodalSpring spring = springs[s];
    vec3 diagonal = spring.stiffness_a.xyz;
    float xy = spring.stiffness_a.w;
    float yz = spring.stiffness_b.x;
    float zx = spring.stiffness_b.y;
    vec3 pull = vec3(spring.stiffness_b.zw, spring.force_z.x);
    return pull - (diagonal * u + vec3(xy * u.y + zx * u.z, xy * u.x + yz * u.z, zx * u.x + yz * u.y));
}
