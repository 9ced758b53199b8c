#pragma once
/// A mesh, opened along interfaces that slide.

#include "meshing/tet_mesh.hpp"
#include "tled/effects.hpp"

#include <Eigen/Core>

#include <array>
#include <string>
#include <vector>

namespace tissuewarp::tled {

/// A face of the closed mesh, and the tetrahedra on its sides; no outer one outside.
struct TissueFace {
    meshing::InterfaceFace face;
    int inner_tet = -1, outer_tet = -1;
};

struct TissueMesh {
    meshing::TetMesh mesh;          ///< nodes of the closed mesh first, then their copies
    Eigen::Matrix4Xi closed_tets;   ///< of the closed mesh
    std::vector<TissueFace> faces;  ///< interface_faces() of the closed mesh

    /// The node that a tetrahedron has in the place of one of its nodes in the closed mesh.
    [[nodiscard]] int node_of(int node, int tet) const;
};

/// Throws InvalidInput for an invalid mesh.
TissueMesh closed(meshing::TetMesh mesh);

/// The same mesh without copies of nodes: those at one place become the first of them.
meshing::TetMesh rejoined(const meshing::TetMesh& mesh);

/// The tissue on both sides of an interface that is to open.
struct InterfaceSides {
    std::vector<int> first, second;  ///< tetrahedra
    std::string name;                ///< "labels 1 and 2", for messages
};
InterfaceSides sides_of_labels(const TissueMesh& tissue, const std::array<int, 2>& labels);

/// Gives the tetrahedra of the second side nodes of their own along its faces with the first, except at `joined` nodes
/// and where other tissue touches it. One pair for each, normal out of the first side, of stiffness `per_area` (kPa/mm)
/// times the node's share of the area. Throws InvalidInput where the sides share tetrahedra or do not touch, and where
/// nothing can open.
std::vector<SlidingPair> open_interface(TissueMesh& tissue, const InterfaceSides& sides,
                                              const std::vector<int>& joined, double per_area);

}  // namespace tissuewarp::tled
