// Gives: the unit of every texture of the render passes, all different, so that what stays is bound once for a run (16,
// as many as every fragment shader of OpenGL has; the host asks the linked program and never repeats these numbers); and
// the form in which one texture names a texel of another.

#define UNIT_DISPLACEMENT 0         // mm, xyz of node
#define UNIT_INCREMENT 1            // u - u⁻, mm, xyz of node
#define UNIT_INVERSE_MASS 2         // xyz of node, zero where constrained
#define UNIT_ELEMENT_NODES 3
#define UNIT_ELEMENT_REST_1 4
#define UNIT_ELEMENT_REST_2 5
#define UNIT_ELEMENT_REST_3 6
#define UNIT_MATERIAL_PARAMETERS 7  // kPa
#define UNIT_NODE_ELEMENTS 8
#define UNIT_FORCE_COORDINATES 9
#define UNIT_CORNER_FORCE_0 10      // mN, one texture for each corner of the elements
#define UNIT_CORNER_FORCE_1 11
#define UNIT_CORNER_FORCE_2 12
#define UNIT_CORNER_FORCE_3 13

/// Column in bits 0 to 14, row in bits 15 to 29; bits 30 and 31 are free for a corner.
ivec2 texel_of(uint coordinates) { return ivec2(coordinates & 0x7fffu, (coordinates >> 15) & 0x7fffu); }

uint coordinates_of(ivec2 texel) { return uint(texel.x) | (uint(texel.y) << 15); }
