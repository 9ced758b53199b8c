#include "registration/terms/organ_surface.hpp"

#include "core/errors.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace tissuewarp::registration::detail {

namespace {

std::array<int, 3> sorted(std::array<int, 3> nodes) {
    std::sort(nodes.begin(), nodes.end());
    return nodes;
}

}  // namespace

OrganSurface::OrganSurface(const PreparedModel& prepared) {
    const meshing::TetMesh& mesh = prepared.model.mesh;
    std::map<int, Eigen::Vector3d> places;
    for (const InterfaceNode& node : prepared.interfaces.nodes()) {
        if (node.outer != 0 || std::isnan(node.offset)) continue;
        places[node.node] = mesh.nodes.col(node.node) + node.offset * node.normal;
    }
    std::map<int, int> index;
    for (const auto& [node, place] : places) {
        index[node] = static_cast<int>(node_of.size());
        node_of.push_back(node);
    }
    std::map<std::array<int, 3>, int> tet_of_face;
    for (int tet = 0; tet < mesh.tet_count(); ++tet)
        for (int left_out = 0; left_out < 4; ++left_out) {
            std::array<int, 3> face{};
            for (int k = 0; k < 3; ++k) face[static_cast<std::size_t>(k)] = mesh.tets((left_out + 1 + k) % 4, tet);
            if (places.contains(face[0]) && places.contains(face[1]) && places.contains(face[2]))
                tet_of_face[sorted(face)] = tet;
        }
    std::vector<Eigen::Vector3i> triangles;
    for (const std::array<int, 3>& face : prepared.interfaces.outer_faces()) {
        const auto [a, b, c] = face;
        if (!places.contains(a) || !places.contains(b) || !places.contains(c)) continue;
        triangles.emplace_back(index[a], index[b], index[c]);
        tet_of.push_back(tet_of_face.at(sorted(face)));
    }
    if (triangles.empty()) throw InvalidInput("the model has no outer surface that the image shows");
    at_rest.nodes.resize(3, static_cast<Eigen::Index>(node_of.size()));
    for (const auto& [node, place] : places) at_rest.nodes.col(index[node]) = place;
    at_rest.triangles.resize(3, static_cast<Eigen::Index>(triangles.size()));
    for (std::size_t t = 0; t < triangles.size(); ++t)
        at_rest.triangles.col(static_cast<Eigen::Index>(t)) = triangles[t];
}

meshing::SurfaceMesh OrganSurface::deformed(const Eigen::Matrix3Xd& displacement) const {
    return {at_rest.nodes + displacement(Eigen::all, node_of), at_rest.triangles};
}

double OrganSurface::area() const {
    double area = 0;
    for (const auto& triangle : at_rest.triangles.colwise()) {
        const Eigen::Vector3d a = at_rest.nodes.col(triangle[0]), b = at_rest.nodes.col(triangle[1]),
                              c = at_rest.nodes.col(triangle[2]);
        area += 0.5 * (b - a).cross(c - a).norm();
    }
    return area;
}

meshing::Location OrganSurface::location(int triangle, const Eigen::Vector3d& barycentric,
                                         const meshing::TetMesh& mesh) const {
    meshing::Location at;
    at.tet = tet_of[static_cast<std::size_t>(triangle)];
    for (int corner = 0; corner < 3; ++corner) {
        const int node = node_of[static_cast<std::size_t>(at_rest.triangles(corner, triangle))];
        for (int k = 0; k < 4; ++k)
            if (mesh.tets(k, at.tet) == node) at.barycentric[k] = barycentric[corner];
    }
    return at;
}

}  // namespace tissuewarp::registration::detail
