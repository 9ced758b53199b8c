// Gives: the bindings of image matching, whose passes share no block with a step or a warp, and its grids. A working grid
// lies in the moving image; the wide grid is that grid with a rim of MATCH_RIM voxels about it, so that filters need not
// mind its border. Offsets count voxels, i fastest.

#define BINDING_MATCH_GRID 0

// Field and samples on the wide grid.
#define BINDING_MATCH_OWNER 1
#define BINDING_MATCH_ELEMENTS 2
#define BINDING_MATCH_NODES 3
#define BINDING_MATCH_FIELD_X 4
#define BINDING_MATCH_FIELD_Y 5
#define BINDING_MATCH_FIELD_Z 6
#define BINDING_MATCH_GROWTH 7
#define BINDING_MATCH_FIXED 8
#define BINDING_MATCH_FIXED_SEEN 9
#define BINDING_MATCH_VALUE 10
#define BINDING_MATCH_SEEN 11

// Filters.
#define BINDING_MATCH_SOURCE 12
#define BINDING_MATCH_TARGET 13
#define BINDING_MATCH_PARTIAL 14
#define BINDING_MATCH_MEAN 15

// Descriptors, of which six distance maps take the place of the field.
#define BINDING_MATCH_DISTANCE_0 1
#define BINDING_MATCH_DISTANCE_1 2
#define BINDING_MATCH_DISTANCE_2 3
#define BINDING_MATCH_DISTANCE_3 4
#define BINDING_MATCH_DISTANCE_4 5
#define BINDING_MATCH_DISTANCE_5 6
#define BINDING_MATCH_DESCRIPTORS 16
#define BINDING_MATCH_SHOWN 17

// Forces.
#define BINDING_MATCH_MOVING 18
#define BINDING_MATCH_COUNTS 19
#define BINDING_MATCH_CELLS 20

// Blocks, of which one image is bound as descriptors and what is shown, the other as moving and what is seen.
#define BINDING_MATCH_SEARCH 21
#define BINDING_MATCH_BLOCKS 22

// Distance maps as a filter leaves them, which neither samples nor looks at masks.
#define BINDING_MATCH_SMOOTHED_0 7
#define BINDING_MATCH_SMOOTHED_1 8
#define BINDING_MATCH_SMOOTHED_2 9
#define BINDING_MATCH_SMOOTHED_3 11
#define BINDING_MATCH_SMOOTHED_4 12
#define BINDING_MATCH_SMOOTHED_5 13

// Ultrasound, whose passes share no other block.
#define BINDING_ECHO_SEARCH 1
#define BINDING_ECHO_WEIGHTS 2
#define BINDING_ECHO_SEEN 3
#define BINDING_ECHO_FIXED 4
#define BINDING_ECHO_MOVING 5
#define BINDING_ECHO_SHOWN 6
#define BINDING_ECHO_SOURCE 7
#define BINDING_ECHO_TARGET 8
#define BINDING_ECHO_PLACES 9
#define BINDING_ECHO_SHARES 10
#define BINDING_ECHO_COSTS 11

const int match_rim = 8;         // GridSamples::rim
const int octahedron_radius = 2; // voxels from a voxel to the six neighbours whose patches are compared
const int patch_radius = 4;      // voxels, where a Gaussian of one voxel has ended

layout(std430, binding = BINDING_MATCH_GRID) readonly buffer MatchGrid {
    uvec4 wide_size;           // voxels along i, j, k
    uvec4 fixed_size;          // of the fixed image
    uvec4 cell_count;          // cells along i, j, k
    vec4 to_fixed_index[3];    // rows: index of the fixed image where the placement alone takes a voxel of the wide grid
    vec4 shift_to_index[3];    // rows: what a displacement (mm, moving frame) adds, voxels
};

uint wide_count() { return wide_size.x * wide_size.y * wide_size.z; }

uvec3 wide_voxel(uint offset) {
    uint row = offset / wide_size.x;
    return uvec3(offset - row * wide_size.x, row % wide_size.y, row / wide_size.y);
}

/// Distances of offsets along i, j, k.
uvec3 wide_stride() { return uvec3(1u, wide_size.x, wide_size.x * wide_size.y); }

/// Whether a voxel of the wide grid lies `margin` voxels or more within it along each axis.
bool within(uvec3 voxel, uvec3 margin) {
    return all(greaterThanEqual(voxel, margin)) && all(lessThan(voxel + margin, wide_size.xyz));
}

/// The grid without its rim.
uvec3 grid_size() { return wide_size.xyz - uint(2 * match_rim); }
uint grid_offset(uvec3 voxel) { return voxel.x + grid_size().x * (voxel.y + grid_size().y * voxel.z); }

/// An entry of the cube of places within some reach, i fastest.
ivec3 place_in_cube(uint n, int cube_reach) {
    int side = 2 * cube_reach + 1, m = int(n);
    return ivec3(m % side, m / side % side, m / (side * side)) - cube_reach;
}
