// Needs: bindings, patch.
// Gives: the state of the slots of all patches, in planes of one number of every slot.

/// u.x, u.y, u.z, v.x, v.y, v.z, mm; behind them what effects keep.
layout(std430, binding = BINDING_PATCH_STATE) buffer PatchState { float patch_state[]; };

float state_number(uint s, uint plane) { return patch_state[plane * slots_of_all + s]; }
vec3 state_plane(uint s, uint plane) {
    return vec3(state_number(s, plane), state_number(s, plane + 1u), state_number(s, plane + 2u));
}

void store_state_number(uint s, uint plane, float value) { patch_state[plane * slots_of_all + s] = value; }
void store_state(uint s, uint plane, vec3 value) {
    store_state_number(s, plane, value.x);
    store_state_number(s, plane + 1u, value.y);
    store_state_number(s, plane + 2u, value.z);
}
