#include "tled/tissue_mesh.hpp"

#include "core/errors.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <map>
#include <set>

namespace tissuewarp::tled {

using Eigen::Vector3d;
using meshing::InterfaceFace;

int TissueMesh::node_of(int node, int tet) const {
    int corner = 0;
    while (corner < 3 && closed_tets(corner, tet) != node) ++corner;
    return mesh.tets(corner, tet);
}

namespace {

using Corners = std::array<int, 3>;

Corners sorted(Corners nodes) {
    std::sort(nodes.begin(), nodes.end());
    return nodes;
}

/// The tetrahedra on both sides of the faces.
std::vector<TissueFace> between_tets(const meshing::TetMesh& mesh, const std::vector<InterfaceFace>& faces) {
    std::map<Corners, std::size_t> place;
    std::vector<TissueFace> found;
    std::vector<bool> on_faces(static_cast<std::size_t>(mesh.node_count()), false);  // few nodes are
    for (const InterfaceFace& face : faces) {
        for (const int node : face.nodes) on_faces[static_cast<std::size_t>(node)] = true;
        place[sorted(face.nodes)] = found.size();
        found.push_back({face});
    }
    for (int e = 0; e < mesh.tet_count(); ++e)
        for (int apex = 0; apex < 4; ++apex) {
            const auto node = [&](int k) { return mesh.tets((apex + k) % 4, e); };
            const Corners corners{node(1), node(2), node(3)};
            if (!std::all_of(corners.begin(), corners.end(),
                             [&](int corner) { return on_faces[static_cast<std::size_t>(corner)]; }))
                continue;
            const auto face = place.find(sorted(corners));
            if (face == place.end()) continue;
            TissueFace& each = found[face->second];
            (mesh.labels[e] == each.face.inner ? each.inner_tet : each.outer_tet) = e;
        }
    return found;
}

constexpr int elsewhere = 1, on_second = 2, on_first = 3;

/// The mesh as it is, with the sides as its labels.
meshing::TetMesh labelled_by_side(const TissueMesh& tissue, const InterfaceSides& sides) {
    meshing::TetMesh mesh = tissue.mesh;
    mesh.labels.setConstant(elsewhere);
    for (const int e : sides.second) mesh.labels[e] = on_second;
    for (const int e : sides.first) {
        if (mesh.labels[e] == on_second)
            throw InvalidInput(sides.name +
                               " share tetrahedra, and what slides lies on one side; let them differ, by "
                               "'without'");
        mesh.labels[e] = on_first;
    }
    return mesh;
}

/// Sum of the area normals of its faces between the sides at each of their nodes, out of the first; a third each.
std::map<int, Vector3d> area_normals(const meshing::TetMesh& by_side) {
    std::map<int, Vector3d> normals;
    for (const InterfaceFace& face : meshing::interface_faces(by_side)) {
        if (face.inner != on_first || face.outer != on_second) continue;
        const auto at = [&](std::size_t corner) { return by_side.nodes.col(face.nodes[corner]); };
        const Vector3d area = 1.0 / 6 * Vector3d(at(1) - at(0)).cross(Vector3d(at(2) - at(0)));
        for (const int node : face.nodes) normals.try_emplace(node, Vector3d::Zero()).first->second += area;
    }
    return normals;
}

/// Nodes that stay as they are: those told, and those of tissue on neither side.
std::set<int> staying(const TissueMesh& tissue, const meshing::TetMesh& by_side, const std::vector<int>& joined) {
    std::set<int> nodes(joined.begin(), joined.end());
    for (int e = 0; e < by_side.tet_count(); ++e) {
        if (by_side.labels[e] != elsewhere) continue;
        nodes.insert(tissue.mesh.tets.col(e).begin(), tissue.mesh.tets.col(e).end());
    }
    return nodes;
}

}  // namespace

TissueMesh closed(meshing::TetMesh mesh) {
    meshing::require_valid(mesh, "the mesh");
    std::vector<TissueFace> faces = between_tets(mesh, meshing::interface_faces(mesh));
    Eigen::Matrix4Xi tets = mesh.tets;
    return {std::move(mesh), std::move(tets), std::move(faces)};
}

meshing::TetMesh rejoined(const meshing::TetMesh& mesh) {
    std::map<std::array<double, 3>, int> first;
    std::vector<int> kept;
    Eigen::VectorXi node_of(mesh.node_count());
    for (int node = 0; node < mesh.node_count(); ++node) {
        const auto x = mesh.nodes.col(node);
        const auto [at, fresh] = first.try_emplace({x[0], x[1], x[2]}, static_cast<int>(kept.size()));
        node_of[node] = at->second;
        if (fresh) kept.push_back(node);
    }
    meshing::TetMesh joined = mesh;
    joined.nodes = mesh.nodes(Eigen::all, kept).eval();
    joined.tets = mesh.tets.unaryExpr([&](int node) { return node_of[node]; });
    return joined;
}

InterfaceSides sides_of_labels(const TissueMesh& tissue, const std::array<int, 2>& labels) {
    InterfaceSides sides;
    sides.name = "labels " + std::to_string(labels[0]) + " and " + std::to_string(labels[1]);
    for (int e = 0; e < tissue.mesh.tet_count(); ++e) {
        if (tissue.mesh.labels[e] == labels[0]) sides.first.push_back(e);
        if (tissue.mesh.labels[e] == labels[1]) sides.second.push_back(e);
    }
    return sides;
}

std::vector<SlidingPair> open_interface(TissueMesh& tissue, const InterfaceSides& sides, const std::vector<int>& joined,
                                        double per_area) {
    const meshing::TetMesh by_side = labelled_by_side(tissue, sides);
    const std::map<int, Vector3d> normals = area_normals(by_side);
    if (normals.empty()) throw InvalidInput(sides.name + " share no face of the mesh and cannot slide");
    const std::set<int> stay = staying(tissue, by_side, joined);
    std::map<int, int> copies;
    std::vector<SlidingPair> pairs;
    int next = tissue.mesh.node_count();
    for (const auto& [node, area] : normals) {
        if (stay.contains(node) || !(area.norm() > 0)) continue;
        copies[node] = next;
        pairs.push_back({node, next++, area.normalized(), per_area * area.norm()});
    }
    if (pairs.empty()) throw InvalidInput("all nodes between " + sides.name + " stay joined: nothing can slide");
    tissue.mesh.nodes.conservativeResize(3, next);
    for (const SlidingPair& pair : pairs) tissue.mesh.nodes.col(pair.second) = tissue.mesh.nodes.col(pair.first);
    for (const int e : sides.second)
        for (int& node : tissue.mesh.tets.col(e))
            if (const auto copy = copies.find(node); copy != copies.end()) node = copy->second;
    return pairs;
}

}  // namespace tissuewarp::tled
