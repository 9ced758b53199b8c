#pragma once
/// Tetrahedra → label map or mask.

#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"

namespace tissuewarp::registration {

/// On a grid, int32: of each voxel whose centre lies in a tetrahedron the label of that, 0 elsewhere.
imaging::Volume labels_of_mesh(const meshing::TetMesh& mesh, const imaging::Geometry& grid);

/// On a grid, uint8: 1 in each voxel whose centre lies in a tetrahedron, 0 elsewhere.
imaging::Volume mask_of_mesh(const meshing::TetMesh& mesh, const imaging::Geometry& grid);

}  // namespace tissuewarp::registration
