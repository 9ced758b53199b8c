#pragma once
/// The mesh of a scene, opened along interfaces that slide.

#include "meshing/tet_mesh.hpp"
#include "tled/effects.hpp"

#include <array>
#include <map>
#include <utility>
#include <vector>

namespace tissuewarp::simulation {

struct TissueMesh {
    meshing::TetMesh mesh;                      ///< nodes of the closed mesh first, then their copies
    std::vector<meshing::InterfaceFace> faces;  ///< interface_faces() of the closed mesh
    std::map<std::pair<int, int>, int> copies;  ///< (node, label) → the copy that tetrahedra of this label have

    /// The node that tetrahedra of `label` have in the place of a node of the closed mesh.
    [[nodiscard]] int node_of(int node, int label) const;
};

/// Throws InvalidInput for an invalid mesh.
TissueMesh closed(meshing::TetMesh mesh);

/// Gives the tetrahedra of the second label nodes of their own along its interface with the first, except at `joined`
/// nodes and where a third label touches it. One pair for each, normal out of the first label, of stiffness `per_area`
/// (kPa/mm) times the node's share of the area. Throws InvalidInput where the labels do not touch or nothing can open.
std::vector<tled::SlidingPair> open_interface(TissueMesh& tissue, const std::array<int, 2>& labels,
                                              const std::vector<int>& joined, double per_area);

}  // namespace tissuewarp::simulation
