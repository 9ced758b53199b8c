// Needs: bindings. Uniform 0 is the number of nodes.
// Gives: gathered_force(a), the internal force on node a (mN): the sum of the corner forces that the element pass left,
// in the fixed order of the list, so that results repeat bit by bit.

layout(location = 0) uniform uint node_count;

/// node_count + 1 offsets, then the entries: positions in corner_force.
layout(std430, binding = BINDING_NODE_INCIDENCE) readonly buffer NodeIncidence { uint node_incidence[]; };
layout(std430, binding = BINDING_CORNER_FORCE) readonly buffer CornerForce { vec4 corner_force[]; };

vec3 gathered_force(uint a) {
    uint begin = node_count + 1u + node_incidence[a];
    uint end = node_count + 1u + node_incidence[a + 1u];
    vec3 sum = vec3(0.0);
    for (uint i = begin; i < end; ++i) sum += corner_force[node_incidence[i]].xyz;
    return sum;
}
