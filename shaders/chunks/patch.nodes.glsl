// Needs: bindings, patch; the chunks node.* of the effects whose flags are 1.
// Gives: the nodes of a patch in shared memory: load_node, node, advance_node, store_displacement.
//! define STAYS
//! define HAS_SPRINGS
//! define HAS_EXTERNAL_FORCE
//! define HAS_FLUID
//! define HAS_CONTACT

/// Planes of all slots: X.x, X.y, X.z (mm, from a point of the patch), inverse mass or, where its components differ, a
/// negative number, its components, and 1 / V_a (1/mm³) of the averaged pressure.
layout(std430, binding = BINDING_PATCH_REST) readonly buffer PatchRest { float patch_rest[]; };
/// Planes of all slots: u.x, u.y, u.z, v.x, v.y, v.z, mm.
layout(std430, binding = BINDING_PATCH_STATE) buffer PatchState { float patch_state[]; };
#if HAS_SPRINGS || HAS_EXTERNAL_FORCE || HAS_FLUID || HAS_CONTACT
layout(std430, binding = BINDING_PATCH_NODE) readonly buffer PatchNode { uint node_of_slot[]; };
#endif

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

vec3 state_plane(uint s, uint plane) {
    return vec3(patch_state[plane * slots_of_all + s], patch_state[(plane + 1u) * slots_of_all + s],
                patch_state[(plane + 2u) * slots_of_all + s]);
}

void store_state(uint s, uint plane, vec3 value) {
    patch_state[plane * slots_of_all + s] = value.x;
    patch_state[(plane + 1u) * slots_of_all + s] = value.y;
    patch_state[(plane + 2u) * slots_of_all + s] = value.z;
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

/// The time step in increment form under the internal force f, mN: v⁺ = momentum v + gain r / m, u⁺ = u + v⁺. Unless
/// the patch stays in shared memory, u⁺ goes to memory too.
void advance_node(uint s, uint i, vec3 f, float momentum, float gain) {
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
    vec3 weight = inverse_mass(s);
    vec3 v = momentum * state_plane(s, 3u) + gain * (residual * weight);
    u += v;
#if HAS_CONTACT
    settle(node_of_slot[s], equal(weight, vec3(0.0)), u, v);
#endif
    store_state(s, 3u, v);
    node_b[i].y = u.x;
    node_c[i] = u.yz;
#if !STAYS
    store_state(s, 0u, u);
#endif
}
