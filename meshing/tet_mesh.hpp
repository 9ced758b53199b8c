#pragma once
/// Tetrahedral and triangle meshes as plain Eigen arrays. Coordinates are LPS mm.

#include <Eigen/Core>

#include <array>
#include <vector>

namespace tissuewarp::meshing {

/// Tetrahedra with a label each. Positively oriented: det[x1−x0, x2−x0, x3−x0] > 0.
struct TetMesh {
    Eigen::Matrix3Xd nodes;  ///< 3 × N, LPS mm
    Eigen::Matrix4Xi tets;   ///< 4 × M, node indices
    Eigen::VectorXi labels;  ///< M, label of the tissue (> 0)

    [[nodiscard]] int node_count() const { return static_cast<int>(nodes.cols()); }
    [[nodiscard]] int tet_count() const { return static_cast<int>(tets.cols()); }
};

/// Triangles whose right-hand normal points outward.
struct SurfaceMesh {
    Eigen::Matrix3Xd nodes;      ///< 3 × N, LPS mm
    Eigen::Matrix3Xi triangles;  ///< 3 × M, node indices

    [[nodiscard]] int node_count() const { return static_cast<int>(nodes.cols()); }
    [[nodiscard]] int triangle_count() const { return static_cast<int>(triangles.cols()); }
};

/// A face of a tetrahedral mesh between two labels. `nodes` index the mesh; the right-hand normal points from
/// `inner` (the smaller region by convention of the call) to `outer`; 0 is the outside.
struct InterfaceFace {
    std::array<int, 3> nodes;
    int inner = 0;
    int outer = 0;
};

/// Signed volume of every tetrahedron, mm³.
Eigen::VectorXd tet_volumes(const TetMesh& mesh);

/// Every face between different labels and every face to the outside, each once, normal from `inner` to `outer`.
/// For two labels a > b > 0 `inner` is a; for the outside `outer` is 0. Sorted by (inner, outer, nodes).
std::vector<InterfaceFace> interface_faces(const TetMesh& mesh);

/// The outer boundary, with `node_of[k]` the mesh node of surface node k.
struct BoundarySurface {
    SurfaceMesh surface;
    std::vector<int> node_of;
};
BoundarySurface boundary_surface(const TetMesh& mesh);

/// Area-weighted unit normals of the nodes, 3 × N; zero for nodes without triangles.
Eigen::Matrix3Xd node_normals(const SurfaceMesh& surface);

/// Throws InvalidInput unless indices are in range, coordinates finite, volumes positive and labels > 0.
void require_valid(const TetMesh& mesh, const char* name);

}  // namespace tissuewarp::meshing
