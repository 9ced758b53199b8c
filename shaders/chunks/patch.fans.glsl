// Needs: bindings, index, patch, patch.nodes.
// Gives: fans, tetrahedra around a common edge a b, which load and leave each node once.

/// FANS for each patch: nodes a, b, c_0, c_1 … of a fan, 16 bits each, 0xffff behind the last: tetrahedra (a, b, c_i, c_(i+1)).
layout(std430, binding = BINDING_PATCH_FANS) readonly buffer PatchFans { uvec4 patch_fans[]; };

const uint no_node = 0xffffu;

uvec4 fan_of(Patch here, uint f) { return patch_fans[here.index * FANS + min(f, FANS - 1u)]; }

/// The nodes of the ring behind c_0 in the order of the fan; next_of_ring takes the first away.
struct Ring {
    uint next;
    uvec2 behind;
};

Ring ring_of(uvec4 fan) { return Ring(fan.y >> 16u, fan.zw); }

Ring next_of_ring(Ring ring) {
    return Ring(ring.behind.x & 0xffffu,
                uvec2(ring.behind.x >> 16u | ring.behind.y << 16u, ring.behind.y >> 16u | 0xffff0000u));
}

/// Edges of a tetrahedron from the node a, at rest and moved: G = (u_b - u_a, u_c - u_a, u_d - u_a), and N whose columns
/// are 6 V times the shape-function gradients of b, c and d.
struct Edges {
    vec3 rest_b, rest_c, rest_d;
    mat3 G, N;
};

Edges first_edges(Node a, Node b, Node c) {
    Edges t;
    t.rest_b = b.X - a.X;
    t.rest_d = c.X - a.X;
    t.G[0] = b.u - a.u;
    t.G[2] = c.u - a.u;
    t.N[1] = cross(t.rest_d, t.rest_b);
    return t;
}

/// The next tetrahedron: its c is the last one's d, its d is new.
Edges next_edges(Edges t, Node a, Node d) {
    t.rest_c = t.rest_d;
    t.G[1] = t.G[2];
    t.N[2] = -t.N[1];
    t.rest_d = d.X - a.X;
    t.G[2] = d.u - a.u;
    t.N[1] = cross(t.rest_d, t.rest_b);
    t.N[0] = cross(t.rest_c, t.rest_d);
    return t;
}
