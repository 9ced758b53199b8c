// Needs: bindings.
// Gives: node_of_slot, for effects that look up what they know of a node.
layout(std430, binding = BINDING_PATCH_NODE) readonly buffer PatchNode { uint node_of_slot[]; };
