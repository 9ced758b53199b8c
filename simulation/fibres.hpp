#pragma once
/// Fibre directions that vary in space.

#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"

#include <Eigen/Core>

#include <string>
#include <variant>

namespace tissuewarp::simulation {

/// On a grid around the tissue: vectors of any length along the fibres, either way, LPS, three components of float32.
struct FibreVolume {
    imaging::Volume directions;
};

/// Of each tetrahedron of the mesh that the scene is given: 3 × M, of any length, LPS. What stands at tetrahedra of
/// other labels is not looked at.
struct FibresOfTetrahedra {
    Eigen::Matrix3Xd directions;
};

/// Without either, the tissue has the one direction of its material.
using FibreField = std::variant<std::monostate, FibreVolume, FibresOfTetrahedra>;

/// Unit vectors at the centroids of the tetrahedra of a label, 3 × all tetrahedra, zero at others. Between voxels
/// directions are turned to the side of the nearest one and averaged trilinearly, since a fibre has no sign. Throws
/// InvalidInput with the place (mm) where there is no direction, none that is finite, or no voxel.
Eigen::Matrix3Xd fibres_of(const FibreVolume& fibres, const meshing::TetMesh& mesh, int label);
Eigen::Matrix3Xd fibres_of(const FibresOfTetrahedra& fibres, const meshing::TetMesh& mesh, int label);

}  // namespace tissuewarp::simulation
