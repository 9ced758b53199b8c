#pragma once
/// Where labels of a mesh meet: the nodes that a label map says something of.

#include "meshing/tet_mesh.hpp"
#include "tled/effects.hpp"

#include <Eigen/Core>

#include <array>
#include <map>
#include <vector>

namespace tissuewarp::registration {

/// A node of the mesh on the interface between two labels. A node where several interfaces meet occurs once for each.
struct InterfaceNode {
    int node = -1;
    int inner = 0, outer = 0;                          ///< labels; 0 is the outside
    double area = 0;                                   ///< a third of the adjacent interface triangles, mm²
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, rest configuration, from inner to outer
    double offset = 0;       ///< mm along the normal from the node to the moving label boundary
    bool at_cavity = false;  ///< what was beyond it is gone: nothing around the organ holds it
    bool slides = false;     ///< along the outer label's tissue, whose interface has nodes of its own
};

/// Interface triangles of a mesh gathered at nodes, and recomputed normals for a deformed state.
class Interfaces {
public:
    explicit Interfaces(const meshing::TetMesh& mesh);
    /// Of a mesh that is open where tissue slides: faces between such pairs of nodes are interfaces of both sides, whose
    /// outer label is the other side's.
    Interfaces(const meshing::TetMesh& mesh, const std::vector<tled::SlidingPair>& sliding);
    [[nodiscard]] const std::vector<InterfaceNode>& nodes() const { return nodes_; }
    [[nodiscard]] std::vector<InterfaceNode>& nodes() { return nodes_; }
    /// Triangles of mesh nodes between tissue and the outside.
    [[nodiscard]] std::vector<std::array<int, 3>> outer_faces() const;
    /// Triangles of mesh nodes between the tissue of two labels, or a label and the outside (0), outward of the first.
    [[nodiscard]] std::vector<std::array<int, 3>> faces_between(int inner, int outer) const;
    /// Points spread over the faces that slide, about 1.5 mm apart: 3 × P, of `positions` (3 × mesh nodes).
    [[nodiscard]] Eigen::Matrix3Xd on_sliding_faces(const Eigen::Matrix3Xd& positions) const;
    /// Unit normals at other node positions (3 × mesh nodes), one column per interface node.
    [[nodiscard]] Eigen::Matrix3Xd normals(const Eigen::Matrix3Xd& positions) const;
    /// Positions in nodes() of those that two edges or fewer along the same interface lead to, without the node itself.
    [[nodiscard]] std::vector<std::vector<int>> neighbours() const;
    /// Mean thickness of every label of the mesh that these are the interfaces of, mm: twice its volume over the area
    /// around it, which is the thickness of a plate and 2/3 of a ball's radius.
    [[nodiscard]] std::map<int, double> thickness(const meshing::TetMesh& mesh) const;

private:
    std::vector<InterfaceNode> nodes_;
    std::vector<std::array<int, 3>> faces_;         // mesh nodes
    std::vector<std::array<int, 3>> face_entries_;  // positions in nodes_
};

}  // namespace tissuewarp::registration
