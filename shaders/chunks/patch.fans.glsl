// Needs: bindings, index, patch, patch.nodes.
// Gives: fans, tetrahedra around a common edge a b, which load and leave each node once.

const uint no_node = 0xffffu;

/// Nodes a, b, c_0, c_1 … of a fan, 16 bits each, no_node behind the last: tetrahedra (a, b, c_i, c_(i+1)). fan_room for each
/// patch, behind the heads of all.
uvec4 fan_of(Patch here, uint f) {
    return patch_head[3u * patch_count + here.index * fan_room + min(f, fan_room - 1u)];
}

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

/// A tetrahedron (a, b, c, d) by its edges from a at rest and their displacements u_b - u_a …; normal_b is 6 V times the
/// gradient of b's shape function. Columns of matrices that change in a loop have been seen to be lost: docs/decisions/
/// gpu_arithmetic.md.
struct Edges {
    vec3 rest_b, rest_c, rest_d;
    vec3 moved_b, moved_c, moved_d;
    vec3 normal_b, normal_c, normal_d;
};

/// Before the first tetrahedron of a fan: its c stands in the place of d.
Edges first_edges(Node a, Node b, Node c) {
    vec3 rest_b = b.X - a.X;
    vec3 rest_c = c.X - a.X;
    vec3 none = vec3(0.0);
    return Edges(rest_b, none, rest_c, b.u - a.u, none, c.u - a.u, none, cross(rest_c, rest_b), none);
}

/// The next tetrahedron: its c is the last one's d, its d is new.
Edges next_edges(Edges t, Node a, Node d) {
    vec3 rest_d = d.X - a.X;
    return Edges(t.rest_b, t.rest_d, rest_d, t.moved_b, t.moved_d, d.u - a.u, cross(t.rest_d, rest_d),
                 cross(rest_d, t.rest_b), -t.normal_c);
}
