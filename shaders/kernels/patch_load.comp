// One invocation per slot of the patches: state and inverse mass of its node.
// Needs: index, bindings.

layout(std430, binding = BINDING_DISPLACEMENT) readonly buffer Displacement { vec4 displacement[]; };
layout(std430, binding = BINDING_INCREMENT) readonly buffer Increment { vec4 increment[]; };
layout(std430, binding = BINDING_INVERSE_MASS) readonly buffer InverseMass { vec4 inverse_mass[]; };
layout(std430, binding = BINDING_PATCH_NODE) readonly buffer PatchNode { uint node_of_slot[]; };
layout(std430, binding = BINDING_PATCH_REST) writeonly buffer PatchRest { float patch_rest[]; };
layout(std430, binding = BINDING_PATCH_STATE) writeonly buffer PatchState { float patch_state[]; };

void main() {
    uint s = invocation_index();
    uint count = uint(node_of_slot.length());
    if (s >= count) return;
    uint a = node_of_slot[s];
    if (a == 0xffffffffu) return;
    vec3 m = inverse_mass[a].xyz;
    patch_rest[3u * count + s] = m.x == m.y && m.y == m.z ? m.x : -1.0;
    for (uint c = 0u; c < 3u; ++c) {
        patch_rest[(4u + c) * count + s] = m[c];
        patch_state[c * count + s] = displacement[a][c];
        patch_state[(3u + c) * count + s] = increment[a][c];
    }
}
