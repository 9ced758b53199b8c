// Needs: bindings, patch.
// Gives: where the tetrahedra of patches keep what each has for itself: begin_fan, next_place and the place in hand. Those that are
// first in their fans lie side by side, then the second ones and so on: neighbouring invocations read neighbouring memory.
//! define MOVES_STRESSES

layout(location = 13) uniform uint places;  // of all patches: fan_room patch_count for each tetrahedron of the longest fan

/// Planes of all places: the fibre where the law has one, then those of chunk patch.stresses.
#if MOVES_STRESSES
layout(std430, binding = BINDING_PATCH_TISSUE) buffer PatchTissue { vec2 patch_tissue[]; };
#else
layout(std430, binding = BINDING_PATCH_TISSUE) readonly buffer PatchTissue { vec2 patch_tissue[]; };
#endif

uint place;       // of the tetrahedron in hand
uint place_here;  // the same among those of the patch, where fans have fan_room places in each turn

/// Before the first tetrahedron of fan f.
void begin_fan(Patch here, uint f) {
    place = here.index * fan_room + f - fan_room * patch_count;
    place_here = f - fan_room;
}

void next_place() {
    place += fan_room * patch_count;
    place_here += fan_room;
}
