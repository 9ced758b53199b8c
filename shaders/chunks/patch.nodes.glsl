// Needs: bindings, patch, patch.state; the chunks of the effects whose flags are 1.
// Gives: the nodes of a patch in shared memory: load_node, node, moving, advance_node, store_displacement.
//! define STAYS
//! define HAS_SPRINGS
//! define HAS_EXTERNAL_FORCE
//! define HAS_FLUID
//! define HAS_CONTACT

/// Planes of all slots: X.x, X.y, X.z (mm, from a point of the patch), inverse mass or, where its components differ, a
/// negative number, its components, and 1 / V_a (1/mm³) of the averaged pressure.
layout(std430, binding = BINDING_PATCH_REST) readonly buffer PatchRest { float patch_rest[]; };

shared vec2 node_a[SLOTS], node_b[SLOTS], node_c[SLOTS];  // (X.xy), (X.z, u.x), (u.yz)

struct Node {
    vec3 X, u;
};

Node node(uint i) {
    vec2 b = node_b[i];
    return Node(vec3(node_a[i], b.x), vec3(b.y, node_c[i]));
}

vec3 rest_plane(uint s, uint plane) {
    return vec3(patch_rest[plane * slots_of_all + s], patch_rest[(plane + 1u) * slots_of_all + s],
                patch_rest[(plane + 2u) * slots_of_all + s]);
}

/// Most nodes move freely: one number instead of three.
vec3 inverse_mass(uint s) {
    float all = patch_rest[3u * slots_of_all + s];
    return all < 0.0 ? rest_plane(s, 4u) : vec3(all);
}

/// Slot i of the patch, s of all.
void load_node(uint s, uint i) {
    vec3 X = rest_plane(s, 0u);
    vec3 u = state_plane(s, 0u);
    node_a[i] = X.xy;
    node_b[i] = vec2(X.z, u.x);
    node_c[i] = u.yz;
}

void store_displacement(uint s, uint i) { store_state(s, 0u, vec3(node_b[i].y, node_c[i])); }

/// What a step takes of a slot beside its force: asked for before that, because memory is far.
struct Moving {
    vec3 weight, v;
#if HAS_CONTACT
    KeptTangent tangent;
#endif
};

Moving moving(uint s) {
    Moving m;
    m.weight = inverse_mass(s);
    m.v = state_plane(s, 3u);
#if HAS_CONTACT
    m.tangent = early_tangent(s);
#endif
    return m;
}

/// The time step in increment form under the internal force f, mN: v⁺ = momentum v + gain r / m, u⁺ = u + v⁺. Unless
/// the patch stays in shared memory, u⁺ goes to memory too.
void advance_node(uint s, uint i, Moving m, vec3 f, float momentum, float gain) {
    vec3 u = vec3(node_b[i].y, node_c[i]);
    vec3 residual = -f;
#if HAS_SPRINGS
    residual += spring_force(node_of_slot[s], u);
#endif
#if HAS_EXTERNAL_FORCE
    residual += external_force(node_of_slot[s]);
#endif
#if HAS_FLUID
    residual += fluid_force(node_of_slot[s], u);
#endif
    vec3 v = momentum * m.v + gain * (residual * m.weight);
    u += v;
#if HAS_CONTACT
    settle(s, equal(m.weight, vec3(0.0)), m.tangent, u, v);
#endif
    store_state(s, 3u, v);
    node_b[i].y = u.x;
    node_c[i] = u.yz;
#if !STAYS
    store_state(s, 0u, u);
#endif
}
