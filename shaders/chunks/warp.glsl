// Gives: the bindings of the warp, whose passes run outside of a step and share no block with it, and its two grids.
// "Output index" is the voxel index (i, j, k) of the output grid, "moving index" that of the moving image.

#define BINDING_WARP_GRID 0
#define BINDING_WARP_NODES 1
#define BINDING_WARP_TETRAHEDRA 2
#define BINDING_WARP_PORTIONS 3
#define BINDING_WARP_OWNER 4
#define BINDING_WARP_ELEMENT_FIELD 5
#define BINDING_WARP_MOVING 6
#define BINDING_WARP_RESULT 7
#define BINDING_WARP_COUNTS 8
#define BINDING_WARP_CONTINUATION_X 9
#define BINDING_WARP_CONTINUATION_Y 10
#define BINDING_WARP_CONTINUATION_Z 11

#define NO_OWNER 0xffffffffu

/// Rows (matrix, constant) of affine functions of the output index, for tissue that the placement alone has moved; what
/// the elastic displacement adds goes through to_moving_index.
layout(std430, binding = BINDING_WARP_GRID) readonly buffer WarpGrid {
    uvec4 output_size;        // voxels along i, j, k
    uvec4 moving_size;
    vec4 rigid_offset[3];     // moving index - output index, voxels
    vec4 rigid_field[3];      // X - y, mm, LPS
    vec4 to_moving_index[3];  // voxels/mm, xyz
};

uint voxel_count() { return output_size.x * output_size.y * output_size.z; }

uvec3 output_voxel(uint offset) {
    uint row = offset / output_size.x;
    return uvec3(offset - row * output_size.x, row % output_size.y, row / output_size.y);
}
