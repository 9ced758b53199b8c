#pragma once
/// The closest point of a triangle surface among triangles that face the right way.

#include "meshing/tet_mesh.hpp"

#include <Eigen/Geometry>

#include <optional>
#include <vector>

namespace tissuewarp::registration::detail {

/// Which triangles a point may belong to.
struct NormalGate {
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, of the point
    double least_cosine = -1;                          ///< between it and the triangle's
    bool oriented = true;                              ///< false: the sign of the normal is not known
};

/// A hierarchy of boxes over triangles. Holds copies of what it needs; queries are thread-safe.
class SurfaceTree {
public:
    struct Hit {
        int triangle = -1;
        Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();
        Eigen::Vector3d point = Eigen::Vector3d::Zero();
        Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, of the nodes, interpolated
        double distance = 0;                               ///< mm
    };

    /// Throws InvalidInput when there is no triangle.
    explicit SurfaceTree(const meshing::SurfaceMesh& surface);

    /// The closest point within `reach_mm` on a triangle that passes the gate; among equally close ones the triangle of
    /// the lowest index.
    [[nodiscard]] std::optional<Hit> closest(const Eigen::Vector3d& point, double reach_mm,
                                             const NormalGate& gate = {}) const;

private:
    struct Box {
        Eigen::AlignedBox3d extent;
        int first = 0, count = 0;  // of the triangles in a leaf; count 0: an inner box
        int right = -1;            // the left one follows its parent
    };

    meshing::SurfaceMesh surface_;
    Eigen::Matrix3Xd node_normals_, face_normals_;
    std::vector<int> order_;
    std::vector<Box> boxes_;

    void build(int first, int count, const Eigen::Matrix3Xd& centres);
};

}  // namespace tissuewarp::registration::detail
