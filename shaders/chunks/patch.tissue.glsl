// Needs: bindings, patch.
// Gives: where the tetrahedra of patches keep what each has for itself: begin_fan, next_place and the place in hand. Those that are
// first in their fans lie side by side, then the second ones and so on: neighbouring invocations read neighbouring memory.
// Of patch.fibres, patch.resting or patch.moving: tissue_at, what a place has that stays through a dispatch and so may be asked for
// early, and take_tissue, by which the place in hand has that.

layout(location = 13) uniform uint places;  // of all patches: fan_room patch_count for each tetrahedron of the longest fan

uint place;  // of the tetrahedron in hand

/// Of the first tetrahedron of fan f; anything where the patch has no such fan.
uint first_place(Patch here, uint f) { return here.index * fan_room + min(f, fan_room - 1u); }

void next_place() { place += fan_room * patch_count; }
