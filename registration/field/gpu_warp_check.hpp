#pragma once
/// Whether a device can be trusted with the warp of a patient.

#include "registration/gpu_warp.hpp"

namespace tissuewarp::registration::detail {

/// Strains the mesh in the middle of the output grid and compares field and image of `warp` with the CPU's at up to
/// 32 768 voxels. Drivers can be silently wrong (docs/decisions/gpu_uploads.md). The arguments are those that `warp`
/// was made of. Throws GpuUnavailable where more than one voxel in 200 differs.
void require_right(GpuWarp& warp, const meshing::TetMesh& mesh, const imaging::Volume& moving,
                   const imaging::Geometry& output, const GpuWarpOptions& options);

}  // namespace tissuewarp::registration::detail
