#pragma once
/// Where tissue borders on tissue that is gone.

#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"
#include "registration/boundary/interfaces.hpp"

namespace tissuewarp::registration::detail {

struct CavityWallOptions {
    /// What lies so far beyond a node of the outer surface, along its normal, tells whether it is at the cavity: the
    /// mesh cuts corners of the label map off. As many voxels, where these are longer. Chosen by hand.
    double beyond_mm = 2, beyond_voxels = 1.5;
};
inline constexpr CavityWallOptions cavity_wall_options{};

/// Sets `at_cavity` of the nodes of the outer surface that have resected tissue (labels ≠ 0) beyond them.
void mark_cavity_wall(Interfaces& interfaces, const meshing::TetMesh& mesh, const imaging::Volume& resected);

/// The label (int32) of the voxel nearest to a point (LPS mm), 0 beyond the grid.
int label_at(const imaging::Volume& labels, const Eigen::Vector3d& point);

/// uint8 mask of the voxels that hold nothing of a map.
imaging::Volume all_but(const imaging::Volume& labels);

}  // namespace tissuewarp::registration::detail
