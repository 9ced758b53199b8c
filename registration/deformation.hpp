#pragma once
/// The result of the solver in the patient: where every point of the preoperative tissue went.

#include "meshing/tet_mesh.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::registration {

/// y = placement · (X + u(X)): elastic displacement u in the preoperative (moving) frame, then a rigid motion into the
/// intraoperative (fixed) frame. LPS mm.
struct Deformation {
    meshing::TetMesh mesh;                                        ///< rest positions X, moving frame
    Eigen::Matrix3Xd displacement;                                ///< u at the nodes, 3 × N, mm, moving frame
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed

    /// Positions y of the nodes in the fixed frame, 3 × N.
    [[nodiscard]] Eigen::Matrix3Xd deformed_nodes() const { return placement * (mesh.nodes + displacement); }
    /// The same tetrahedra at y.
    [[nodiscard]] meshing::TetMesh deformed_mesh() const { return {deformed_nodes(), mesh.tets, mesh.labels}; }
};

}  // namespace tissuewarp::registration
