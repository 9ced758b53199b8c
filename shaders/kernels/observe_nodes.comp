// Reduces nodal quantities: one partial result per workgroup, each invocation striding over the nodes, then a tree in
// shared memory; the order is fixed by PARTIALS and WORKGROUP_SIZE, so results repeat bit by bit.
// Needs: index, bindings, numbers. To be dispatched with PARTIALS workgroups in one row.
//! define PARTIALS

layout(location = 0) uniform uint node_count;

layout(std430, binding = BINDING_DISPLACEMENT) readonly buffer Displacement { vec4 displacement[]; };
layout(std430, binding = BINDING_INCREMENT) readonly buffer Increment { vec4 increment[]; };
layout(std430, binding = BINDING_INVERSE_MASS) readonly buffer InverseMass { vec4 inverse_mass[]; };
layout(std430, binding = BINDING_RESIDUAL) readonly buffer Residual { vec4 residual_of_node[]; };
layout(std430, binding = BINDING_PREVIOUS_RESIDUAL) readonly buffer PreviousResidual { vec4 previous_residual[]; };

struct NodePartial {
    float increment_squared_max;  // largest |v|², mm²
    float residual_squared_max;   // largest |r|², mN²
    float increment_mass;         // Σ m v²
    float increment_stiffness;    // Σ v (r⁻ - r), mN mm
    uint bad_displacements;       // nodes with a displacement or increment that is not finite
    uint bad_residuals;
};
layout(std430, binding = BINDING_PARTIAL) writeonly buffer Partial { NodePartial partial[]; };

shared NodePartial lane[WORKGROUP_SIZE];

NodePartial merged(NodePartial a, NodePartial b) {
    return NodePartial(max(a.increment_squared_max, b.increment_squared_max),
                       max(a.residual_squared_max, b.residual_squared_max), a.increment_mass + b.increment_mass,
                       a.increment_stiffness + b.increment_stiffness, a.bad_displacements + b.bad_displacements,
                       a.bad_residuals + b.bad_residuals);
}

/// max() may drop a NaN, so what is not finite is counted and left out of the rest.
NodePartial of_node(uint a) {
    vec3 v = increment[a].xyz;
    vec3 r = residual_of_node[a].xyz;
    bool good = is_finite(displacement[a].xyz) && is_finite(v);
    bool good_residual = is_finite(r);
    NodePartial part = NodePartial(0.0, 0.0, 0.0, 0.0, good ? 0u : 1u, good_residual ? 0u : 1u);
    if (!good || !good_residual) return part;
    vec3 weight = inverse_mass[a].xyz;
    bvec3 constrained = equal(weight, vec3(0.0));
    vec3 mass = mix(1.0 / weight, vec3(0.0), constrained);
    part.increment_squared_max = dot(v, v);
    part.residual_squared_max = dot(r, r);
    part.increment_mass = dot(mass * v, v);
    part.increment_stiffness = dot(v, previous_residual[a].xyz - r);
    return part;
}

void main() {
    uint local = gl_LocalInvocationID.x;
    NodePartial sum = NodePartial(0.0, 0.0, 0.0, 0.0, 0u, 0u);
    for (uint a = gl_WorkGroupID.x * WORKGROUP_SIZE + local; a < node_count; a += PARTIALS * WORKGROUP_SIZE)
        sum = merged(sum, of_node(a));
    lane[local] = sum;
    barrier();
    for (uint half_size = WORKGROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
        if (local < half_size) lane[local] = merged(lane[local], lane[local + half_size]);
        barrier();
    }
    if (local == 0u) partial[gl_WorkGroupID.x] = lane[0];
}
