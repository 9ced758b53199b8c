// One invocation per node: its state from the slot of one of its patches, unless a patch gave up
// (patch.neighbours.glsl).
// Needs: index, bindings.

layout(location = 0) uniform uint node_count;
layout(location = 1) uniform uint slot_count;
layout(location = 2) uniform uint patch_count;

layout(std430, binding = BINDING_DISPLACEMENT) writeonly buffer Displacement { vec4 displacement[]; };
layout(std430, binding = BINDING_INCREMENT) writeonly buffer Increment { vec4 increment[]; };
layout(std430, binding = BINDING_PATCH_STATE) readonly buffer PatchState { float patch_state[]; };
layout(std430, binding = BINDING_PATCH_SLOT) readonly buffer PatchSlot { uint slot_of_node[]; };
layout(std430, binding = BINDING_PATCH_PROGRESS) readonly buffer PatchProgress { uint patch_progress[]; };

vec3 state_plane(uint s, uint plane) {
    return vec3(patch_state[plane * slot_count + s], patch_state[(plane + 1u) * slot_count + s],
                patch_state[(plane + 2u) * slot_count + s]);
}

void main() {
    uint a = invocation_index();
    if (a >= node_count || patch_progress[patch_count] != 0u) return;
    uint s = slot_of_node[a];
    displacement[a] = vec4(state_plane(s, 0u), 0.0);
    increment[a] = vec4(state_plane(s, 3u), 0.0);
}
