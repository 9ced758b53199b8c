// Needs: bindings. Uniform 0 is the number of nodes that surface effects move.
// Gives: what these effects share: for each of the nodes a list of records, each of one thing that pulls it and in the order
// that the host gave, so that sums repeat bit by bit. A record of a face begins with the node's own corner: its edges run
// from there.

layout(location = 0) uniform uint surface_node_count;

layout(std430, binding = BINDING_DISPLACEMENT) readonly buffer Displacement { vec4 displacement[]; };
/// Words, floats by their bits: the nodes; of each effect of the scene surface_node_count + 1 places of this buffer, between
/// which the records of the nodes lie; the records.
layout(std430, binding = BINDING_SURFACE_EFFECTS) readonly buffer SurfaceEffects { uint surface_effects[]; };

float surface_number(uint at) { return uintBitsToFloat(surface_effects[at]); }
vec3 surface_vector(uint at) { return vec3(surface_number(at), surface_number(at + 1u), surface_number(at + 2u)); }

/// How far the node that is named at a place has moved beyond u, mm.
vec3 moved_beyond(uint at, vec3 u) { return displacement[surface_effects[at]].xyz - u; }
