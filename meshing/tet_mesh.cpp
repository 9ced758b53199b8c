#include "meshing/tet_mesh.hpp"

#include "core/errors.hpp"
#include "meshing/detail/faces.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>

namespace tissuewarp::meshing {

namespace {

double signed_volume(const TetMesh& mesh, int t) {
    const Eigen::Vector3d origin = mesh.nodes.col(mesh.tets(0, t));
    const Eigen::Vector3d a = mesh.nodes.col(mesh.tets(1, t)) - origin;
    const Eigen::Vector3d b = mesh.nodes.col(mesh.tets(2, t)) - origin;
    const Eigen::Vector3d c = mesh.nodes.col(mesh.tets(3, t)) - origin;
    return a.cross(b).dot(c) / 6.0;
}

/// The face as seen from one of its tetrahedra, normal outward, smallest node first.
std::array<int, 3> outward_nodes(const TetMesh& mesh, const detail::TetFace& face) {
    const auto& corners = detail::face_corners[face.corner];
    std::array<int, 3> nodes{mesh.tets(corners[0], face.tet), mesh.tets(corners[1], face.tet),
                             mesh.tets(corners[2], face.tet)};
    std::rotate(nodes.begin(), std::min_element(nodes.begin(), nodes.end()), nodes.end());
    return nodes;
}

}  // namespace

Eigen::VectorXd tet_volumes(const TetMesh& mesh) {
    Eigen::VectorXd volumes(mesh.tet_count());
    for (int t = 0; t < mesh.tet_count(); ++t) volumes[t] = signed_volume(mesh, t);
    return volumes;
}

std::vector<InterfaceFace> interface_faces(const TetMesh& mesh) {
    std::vector<InterfaceFace> result;
    detail::for_each_face(detail::sorted_faces(mesh), [&](const detail::TetFace& a, const detail::TetFace* b) {
        const int label_a = mesh.labels[a.tet];
        const int label_b = b ? mesh.labels[b->tet] : 0;
        if (label_a == label_b) return;
        const detail::TetFace& inner = label_a > label_b ? a : *b;
        result.push_back({outward_nodes(mesh, inner), std::max(label_a, label_b), std::min(label_a, label_b)});
    });
    std::sort(result.begin(), result.end(), [](const InterfaceFace& x, const InterfaceFace& y) {
        return std::tie(x.inner, x.outer, x.nodes) < std::tie(y.inner, y.outer, y.nodes);
    });
    return result;
}

BoundarySurface boundary_surface(const TetMesh& mesh) {
    std::vector<std::array<int, 3>> faces;
    detail::for_each_face(detail::sorted_faces(mesh), [&](const detail::TetFace& a, const detail::TetFace* b) {
        if (!b) faces.push_back(outward_nodes(mesh, a));
    });
    std::vector<int> surface_node(static_cast<std::size_t>(mesh.node_count()), -1);
    for (const auto& face : faces)
        for (int node : face) surface_node[static_cast<std::size_t>(node)] = 0;

    BoundarySurface boundary;
    for (int node = 0; node < mesh.node_count(); ++node) {
        if (surface_node[static_cast<std::size_t>(node)] < 0) continue;
        surface_node[static_cast<std::size_t>(node)] = static_cast<int>(boundary.node_of.size());
        boundary.node_of.push_back(node);
    }
    boundary.surface.nodes.resize(3, static_cast<Eigen::Index>(boundary.node_of.size()));
    for (std::size_t k = 0; k < boundary.node_of.size(); ++k)
        boundary.surface.nodes.col(static_cast<Eigen::Index>(k)) = mesh.nodes.col(boundary.node_of[k]);
    boundary.surface.triangles.resize(3, static_cast<Eigen::Index>(faces.size()));
    for (std::size_t f = 0; f < faces.size(); ++f)
        for (int k = 0; k < 3; ++k)
            boundary.surface.triangles(k, static_cast<Eigen::Index>(f)) =
                surface_node[static_cast<std::size_t>(faces[f][k])];
    return boundary;
}

Eigen::Matrix3Xd node_normals(const SurfaceMesh& surface) {
    Eigen::Matrix3Xd normals = Eigen::Matrix3Xd::Zero(3, surface.node_count());
    for (int f = 0; f < surface.triangle_count(); ++f) {
        const Eigen::Vector3i nodes = surface.triangles.col(f);
        const Eigen::Vector3d a = surface.nodes.col(nodes[1]) - surface.nodes.col(nodes[0]);
        const Eigen::Vector3d b = surface.nodes.col(nodes[2]) - surface.nodes.col(nodes[0]);
        const Eigen::Vector3d twice_area = a.cross(b);
        for (int node : nodes) normals.col(node) += twice_area;
    }
    for (int node = 0; node < surface.node_count(); ++node) {
        const double length = normals.col(node).norm();
        if (length > 0.0) normals.col(node) /= length;
    }
    return normals;
}

void require_valid(const TetMesh& mesh, const char* name) {
    const std::string who = std::string("mesh '") + name + "': ";
    if (mesh.tet_count() == 0) throw InvalidInput(who + "has no tetrahedra; at least one is needed");
    if (mesh.labels.size() != mesh.tets.cols())
        throw InvalidInput(who + std::to_string(mesh.labels.size()) + " labels for " +
                           std::to_string(mesh.tet_count()) + " tetrahedra; give one label each");
    for (int n = 0; n < mesh.node_count(); ++n)
        if (!mesh.nodes.col(n).allFinite())
            throw InvalidInput(who + "node " + std::to_string(n) + " has a coordinate that is not finite");
    for (int t = 0; t < mesh.tet_count(); ++t) {
        const std::string tet = who + "tetrahedron " + std::to_string(t);
        for (int node : mesh.tets.col(t))
            if (node < 0 || node >= mesh.node_count())
                throw InvalidInput(tet + " uses node " + std::to_string(node) + "; the mesh has nodes 0 to " +
                                   std::to_string(mesh.node_count() - 1));
        if (mesh.labels[t] <= 0)
            throw InvalidInput(tet + " has label " + std::to_string(mesh.labels[t]) + "; labels must be positive");
        if (const double volume = signed_volume(mesh, t); !(volume > 0.0) || !std::isfinite(volume))
            throw InvalidInput(
                tet + " has volume " + std::to_string(volume) +
                " mm³; volumes must be positive and finite: remove flat elements, swap two nodes of inverted ones");
    }
}

}  // namespace tissuewarp::meshing
