#pragma once
/// Whether two displacement fields undo each other.

#include "registration/evaluation.hpp"

namespace tissuewarp::registration {

struct InverseConsistency {
    Summary error;       ///< ‖u(x) + v(x + u(x))‖, mm, over the voxels whose tissue stays in the backward field
    long long left = 0;  ///< voxels whose tissue leaves the grid of the backward field
};

/// Carries the centre x of every voxel of the forward field u (of a mask on its grid, where given) to x + u(x) and back
/// with the backward field v, trilinear. Both float32, three components, LPS mm, each on its own grid. Throws
/// InvalidInput for a value that is not finite, a mask on another grid, and when no voxel is left.
InverseConsistency inverse_consistency(const imaging::Volume& forward, const imaging::Volume& backward,
                                       const imaging::Volume* mask = nullptr);

}  // namespace tissuewarp::registration
