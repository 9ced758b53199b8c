#pragma once
/// The result of the solver in the patient: where every point of the preoperative tissue went.

#include "imaging/volume.hpp"
#include "meshing/tet_mesh.hpp"

#include <Eigen/Geometry>

#include <optional>
#include <vector>

namespace tissuewarp::registration {

/// How the surroundings of an organ moved: bone, for instance (rigid_surroundings.hpp).
struct Surroundings {
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();  ///< moving → fixed
    imaging::Volume rigid;  ///< voxels of 1 moved by it exactly, uint8, moving frame; where 0 they move so far from
                            ///< the organ
    bool slide = false;     ///< along the organ: beside it they go where its surface goes, not where its tissue goes
    std::vector<Eigen::Isometry3d> bodies = {};  ///< moving → fixed: how voxels of 2, 3, … moved
};

/// y = placement · (X + u(X)): elastic displacement u in the preoperative (moving) frame, then a rigid motion into the
/// intraoperative (fixed) frame. LPS mm.
struct Deformation {
    meshing::TetMesh mesh;                                        ///< rest positions X, moving frame
    Eigen::Matrix3Xd displacement;                                ///< u at the nodes, 3 × N, mm, moving frame
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed
    std::optional<Surroundings> surroundings = {};                ///< where they are known to have moved otherwise

    /// The same map with another rigid part.
    [[nodiscard]] Deformation with_placement(const Eigen::Isometry3d& other) const {
        Deformation same = *this;
        if (other.matrix() == placement.matrix()) return same;
        same.displacement = (other.inverse() * placement) * (mesh.nodes + displacement) - mesh.nodes;
        same.placement = other;
        return same;
    }
    /// What moves far from the organ: the motion of the surroundings, or the placement where that is not known.
    [[nodiscard]] const Eigen::Isometry3d& far_motion() const {
        return surroundings ? surroundings->motion : placement;
    }

    /// Positions y of the nodes in the fixed frame, 3 × N.
    [[nodiscard]] Eigen::Matrix3Xd deformed_nodes() const { return placement * (mesh.nodes + displacement); }
    /// The same tetrahedra at y.
    [[nodiscard]] meshing::TetMesh deformed_mesh() const { return {deformed_nodes(), mesh.tets, mesh.labels}; }
};

}  // namespace tissuewarp::registration
