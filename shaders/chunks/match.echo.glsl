// Gives: Gaussian windows over bricks of two images on one grid, of which the moving one is shifted by whole voxels
// (registration/matching/ultrasound/shifted_windows.hpp). A pass looks at some shifts of the cube of all of them. What
// it leaves lies sum by sum, in each shift by shift, brick by brick.
// Needs: match.

layout(location = 0) uniform uint first_shift;
layout(location = 1) uniform uint shift_count;

layout(std430, binding = BINDING_ECHO_SEARCH) readonly buffer EchoSearch {
    ivec4 voxel_count;    // along i, j, k
    ivec4 brick_count;    // likewise
    int brick_side;       // voxels
    int shift_reach;      // voxels along each axis
    int window_radius;    // bricks
    uint place_count;     // bricks whose windows have costs
    float least_kept;     // of what the ultrasound shows of a window, that the moving image must show too
    float ridge;          // of the regression, in variances of what explains
};

/// Of bricks from −window_radius on.
layout(std430, binding = BINDING_ECHO_WEIGHTS) readonly buffer EchoWeights { float brick_weight[]; };

uint brick_total() { return uint(brick_count.x * brick_count.y * brick_count.z); }

/// From one sum of a shift and a brick to the next sum of them.
uint sum_stride() { return shift_count * brick_total(); }

ivec3 at_offset(int offset, ivec3 size) {
    int row = offset / size.x;
    return ivec3(offset - row * size.x, row % size.y, row / size.y);
}

/// Of the first sum of a shift, counted from first_shift on, and a brick.
int sum_offset(uint shift, uint brick) { return int(shift * brick_total() + brick); }

int voxel_offset(ivec3 voxel) { return voxel.x + voxel_count.x * (voxel.y + voxel_count.y * voxel.z); }

int brick_stride(uint axis) { return axis == 0u ? 1 : axis == 1u ? brick_count.x : brick_count.x * brick_count.y; }

/// The first and the last brick of the window about a brick along an axis, from its middle.
ivec2 window_of(uint brick, uint axis) {
    int at = int(brick) / brick_stride(axis) % brick_count[axis];
    return ivec2(-min(window_radius, at), min(window_radius, brick_count[axis] - 1 - at));  // docs/decisions/gpu_signs.md
}
