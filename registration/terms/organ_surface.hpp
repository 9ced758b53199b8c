#pragma once
/// The organ's surface as the preoperative image shows it.

#include "meshing/point_location.hpp"
#include "registration/prepare.hpp"

#include <vector>

namespace tissuewarp::registration::detail {

/// Outer faces of the mesh that are a boundary of tissue, not a cut by the image's border, moved out to where the
/// labels end.
struct OrganSurface {
    meshing::SurfaceMesh at_rest;  ///< LPS mm, moving frame
    std::vector<int> node_of;      ///< mesh nodes of its nodes
    std::vector<int> tet_of;       ///< tetrahedra of its triangles

    /// Throws InvalidInput where there is none.
    explicit OrganSurface(const PreparedModel& prepared);

    /// With the nodes displaced (3 × mesh nodes, mm).
    [[nodiscard]] meshing::SurfaceMesh deformed(const Eigen::Matrix3Xd& displacement) const;
    /// mm², at rest.
    [[nodiscard]] double area() const;
    /// A place on a triangle as a place in its tetrahedron.
    [[nodiscard]] meshing::Location location(int triangle, const Eigen::Vector3d& barycentric,
                                             const meshing::TetMesh& mesh) const;
};

}  // namespace tissuewarp::registration::detail
