// Gives: the six pairs of patches that hold all twelve edges of the octahedron of a voxel's neighbours: opposite edges
// share a step (registration/matching/descriptors/brick_descriptors.hpp, octahedron_edges()).
// Needs: match.

/// The axes of a pair, and the direction along the second.
int first_axis(uint pair) { return pair < 4u ? 0 : 1; }
int second_axis(uint pair) { return pair < 2u ? 1 : 2; }
int sign_of(uint pair) { return pair % 2u == 0u ? -1 : 1; }

/// From one patch of a pair to the other, voxels.
ivec3 step_of(uint pair) {
    ivec3 result = ivec3(0);
    result[first_axis(pair)] = octahedron_radius;
    result[second_axis(pair)] = sign_of(pair) * octahedron_radius;
    return result;
}

/// Where the map of a pair holds the distance of an edge, from the voxel that it belongs to.
ivec3 shift_of(uint pair, bool opposite) {
    ivec3 result = ivec3(0);
    if (opposite)
        result[first_axis(pair)] = -octahedron_radius;
    else
        result[second_axis(pair)] = -sign_of(pair) * octahedron_radius;
    return result;
}

/// As a difference of offsets, which may be negative.
int wide_difference(ivec3 step) { return step.x + int(wide_size.x) * (step.y + int(wide_size.y) * step.z); }
