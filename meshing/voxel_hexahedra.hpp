#pragma once
/// Label volume → hexahedra, one for each block of voxels: no mesher, steps at surfaces and interfaces.

#include "imaging/volume.hpp"
#include "meshing/hex_cells.hpp"

#include <vector>

namespace tissuewarp::meshing {

struct VoxelHexahedraOptions {
    int coarsening = 1;         ///< voxels along each edge of a hexahedron
    std::vector<int> labels{};  ///< labels to mesh; empty: all but 0
};

/// One hexahedron for each block of coarsening³ voxels whose most frequent label is among those asked for (of equally
/// frequent ones the largest; everything else, and what lies beyond the last voxel, counts as background). Blocks begin
/// at the first voxel of the volume, corners lie on the corners of voxels, in LPS mm whatever the image's axes; no
/// unused nodes; ordered as the voxels. Blocks that touch in an edge or a node alone share it: such a joint is a hinge.
/// `labels` must be int32. Throws InvalidInput (no voxel of a requested label, coarsening below 1, another type).
MixedMesh voxel_hexahedra(const imaging::Volume& labels, const VoxelHexahedraOptions& options = {});

}  // namespace tissuewarp::meshing
