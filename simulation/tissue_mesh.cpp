#include "simulation/tissue_mesh.hpp"

#include "core/errors.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <set>
#include <string>

namespace tissuewarp::simulation {

using Eigen::Vector3d;
using meshing::InterfaceFace;

int TissueMesh::node_of(int node, int label) const {
    const auto copy = copies.find({node, label});
    return copy == copies.end() ? node : copy->second;
}

TissueMesh closed(meshing::TetMesh mesh) {
    meshing::require_valid(mesh, "the mesh of the scene");
    std::vector<InterfaceFace> faces = meshing::interface_faces(mesh);
    return {std::move(mesh), std::move(faces), {}};
}

namespace {

/// Sum of the area normals of its faces between the labels at each of their nodes, out of the first; a third each.
std::map<int, Vector3d> area_normals(const TissueMesh& tissue, const std::array<int, 2>& labels) {
    std::map<int, Vector3d> normals;
    for (const InterfaceFace& face : tissue.faces) {
        const bool out = face.inner == labels[0] && face.outer == labels[1];
        if (!out && !(face.inner == labels[1] && face.outer == labels[0])) continue;
        const auto at = [&](std::size_t corner) { return tissue.mesh.nodes.col(face.nodes[corner]); };
        const Vector3d area = (out ? 1.0 : -1.0) / 6 * Vector3d(at(1) - at(0)).cross(Vector3d(at(2) - at(0)));
        for (const int node : face.nodes) normals.try_emplace(node, Vector3d::Zero()).first->second += area;
    }
    return normals;
}

/// Nodes of tissue that is neither.
std::set<int> nodes_of_others(const TissueMesh& tissue, const std::array<int, 2>& labels) {
    std::set<int> nodes;
    for (int e = 0; e < tissue.mesh.tet_count(); ++e)
        if (tissue.mesh.labels[e] != labels[0] && tissue.mesh.labels[e] != labels[1])
            nodes.insert(tissue.mesh.tets.col(e).begin(), tissue.mesh.tets.col(e).end());
    return nodes;
}

}  // namespace

std::vector<tled::SlidingPair> open_interface(TissueMesh& tissue, const std::array<int, 2>& labels,
                                              const std::vector<int>& joined, double per_area) {
    const std::map<int, Vector3d> normals = area_normals(tissue, labels);
    const std::string names = std::to_string(labels[0]) + " and " + std::to_string(labels[1]);
    if (normals.empty()) throw InvalidInput("labels " + names + " share no face of the mesh and cannot slide");
    std::set<int> stay = nodes_of_others(tissue, labels);
    stay.insert(joined.begin(), joined.end());
    std::vector<tled::SlidingPair> pairs;
    int next = tissue.mesh.node_count();
    for (const auto& [node, area] : normals) {
        if (stay.contains(node) || !(area.norm() > 0)) continue;
        tissue.copies[{node, labels[1]}] = next;
        pairs.push_back({node, next++, area.normalized(), per_area * area.norm()});
    }
    if (pairs.empty()) throw InvalidInput("all nodes between labels " + names + " stay joined: nothing can slide");
    tissue.mesh.nodes.conservativeResize(3, next);
    for (const tled::SlidingPair& pair : pairs) tissue.mesh.nodes.col(pair.second) = tissue.mesh.nodes.col(pair.first);
    for (int e = 0; e < tissue.mesh.tet_count(); ++e)
        if (tissue.mesh.labels[e] == labels[1])
            for (int& node : tissue.mesh.tets.col(e)) node = tissue.node_of(node, labels[1]);
    return pairs;
}

}  // namespace tissuewarp::simulation
