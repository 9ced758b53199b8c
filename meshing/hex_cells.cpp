#include "meshing/hex_cells.hpp"

#include "core/errors.hpp"
#include "meshing/detail/faces.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <string>

namespace tissuewarp::meshing {

namespace {

using Eigen::Vector3d;
using Triangle = std::array<int, 3>;

Triangle sorted_triangle(int a, int b, int c) {
    Triangle nodes{a, b, c};
    std::sort(nodes.begin(), nodes.end());
    return nodes;
}

/// Faces of tetrahedra whose three nodes all belong to hexahedra, sorted.
std::vector<Triangle> triangles_at_hexahedra(const TetMesh& mesh, const HexCells& cells) {
    std::vector<bool> touched(static_cast<std::size_t>(mesh.node_count()), false);
    for (const int node : cells.hexes.reshaped()) touched[static_cast<std::size_t>(node)] = true;
    std::vector<Triangle> triangles;
    for (int t = 0; t < mesh.tet_count(); ++t)
        for (const auto& corners : detail::face_corners) {
            const Triangle nodes =
                sorted_triangle(mesh.tets(corners[0], t), mesh.tets(corners[1], t), mesh.tets(corners[2], t));
            const auto is_touched = [&](int node) { return touched[static_cast<std::size_t>(node)]; };
            if (std::all_of(nodes.begin(), nodes.end(), is_touched)) triangles.push_back(nodes);
        }
    std::sort(triangles.begin(), triangles.end());
    return triangles;
}

/// Each corner of a triangle takes a third of its area vector.
void add_triangle(const HexCorners& x, int a, int b, int c, HexCorners& B) {
    const Vector3d third = (x.col(b) - x.col(a)).cross(x.col(c) - x.col(a)) / 6.0;
    for (const int corner : {a, b, c}) B.col(corner) += third;
}

/// ∮ N n dA of a bilinear face; the integrand is quadratic in each coordinate, so that two Gauss points a way are
/// exact.
void add_bilinear(const HexCorners& x, const std::array<int, 4>& face, HexCorners& B) {
    const double point = 1.0 / std::sqrt(3.0);
    for (const double s : {-point, point})
        for (const double t : {-point, point}) {
            const double N[4] = {(1 - s) * (1 - t) / 4, (1 + s) * (1 - t) / 4, (1 + s) * (1 + t) / 4,
                                 (1 - s) * (1 + t) / 4};
            const Vector3d along_s =
                ((1 - t) * (x.col(face[1]) - x.col(face[0])) + (1 + t) * (x.col(face[2]) - x.col(face[3]))) / 4;
            const Vector3d along_t =
                ((1 - s) * (x.col(face[3]) - x.col(face[0])) + (1 + s) * (x.col(face[2]) - x.col(face[1]))) / 4;
            const Vector3d area = along_s.cross(along_t);
            for (std::size_t k = 0; k < 4; ++k) B.col(face[k]) += N[k] * area;
        }
}

}  // namespace

std::vector<FaceShapes> face_shapes(const TetMesh& mesh, const HexCells& cells) {
    std::vector<FaceShapes> shapes(static_cast<std::size_t>(cells.count()), FaceShapes{});
    const std::vector<Triangle> triangles = triangles_at_hexahedra(mesh, cells);
    if (triangles.empty()) return shapes;
    for (int h = 0; h < cells.count(); ++h)
        for (std::size_t f = 0; f < hex_faces.size(); ++f) {
            const auto node = [&](std::size_t corner) { return cells.hexes(hex_faces[f][corner], h); };
            const auto is_cut = [&](std::size_t a, std::size_t b, std::size_t c) {
                return std::binary_search(triangles.begin(), triangles.end(),
                                          sorted_triangle(node(a), node(b), node(c)));
            };
            FaceShape& shape = shapes[static_cast<std::size_t>(h)][f];
            if (is_cut(0, 1, 2) || is_cut(0, 2, 3)) shape = FaceShape::Diagonal02;
            if (is_cut(0, 1, 3) || is_cut(1, 2, 3)) shape = FaceShape::Diagonal13;
        }
    return shapes;
}

HexCorners hex_corners(const Eigen::Matrix3Xd& nodes, const HexCells& cells, int hex) {
    HexCorners corners;
    for (int corner = 0; corner < 8; ++corner) corners.col(corner) = nodes.col(cells.hexes(corner, hex));
    return corners;
}

HexCorners surface_gradient(const HexCorners& corners, const FaceShapes& faces) {
    HexCorners B = HexCorners::Zero();
    for (std::size_t f = 0; f < hex_faces.size(); ++f) {
        const auto& [a, b, c, d] = hex_faces[f];
        switch (faces[f]) {
            case FaceShape::Bilinear:
                add_bilinear(corners, hex_faces[f], B);
                break;
            case FaceShape::Diagonal02:
                add_triangle(corners, a, b, c, B);
                add_triangle(corners, a, c, d, B);
                break;
            case FaceShape::Diagonal13:
                add_triangle(corners, a, b, d, B);
                add_triangle(corners, b, c, d, B);
                break;
        }
    }
    return B;
}

Eigen::VectorXd hex_volumes(const Eigen::Matrix3Xd& nodes, const HexCells& cells) {
    Eigen::VectorXd volumes(cells.count());
    for (int h = 0; h < cells.count(); ++h) {
        HexCorners corners = hex_corners(nodes, cells, h);
        corners.colwise() -= Vector3d(corners.col(0));
        volumes[h] = surface_gradient(corners).cwiseProduct(corners).sum() / 3.0;
    }
    return volumes;
}

Eigen::VectorXd scaled_jacobians(const Eigen::Matrix3Xd& nodes, const HexCells& cells) {
    // The neighbours of a corner, right-handed.
    constexpr int neighbours[8][3] = {{1, 3, 4}, {2, 0, 5}, {3, 1, 6}, {0, 2, 7},
                                      {7, 5, 0}, {4, 6, 1}, {5, 7, 2}, {6, 4, 3}};
    Eigen::VectorXd result = Eigen::VectorXd::Ones(cells.count());
    for (int h = 0; h < cells.count(); ++h) {
        const HexCorners x = hex_corners(nodes, cells, h);
        for (int corner = 0; corner < 8; ++corner) {
            Eigen::Matrix3d edges;
            for (int k = 0; k < 3; ++k) edges.col(k) = x.col(neighbours[corner][k]) - x.col(corner);
            const double lengths = edges.colwise().norm().prod();
            result[h] = std::min(result[h], lengths > 0.0 ? edges.determinant() / lengths : 0.0);
        }
    }
    return result;
}

void require_valid(const Eigen::Matrix3Xd& nodes, const HexCells& cells, const char* name) {
    const std::string who = std::string("mesh '") + name + "': ";
    if (cells.labels.size() != cells.hexes.cols())
        throw InvalidInput(who + std::to_string(cells.labels.size()) + " labels for " + std::to_string(cells.count()) +
                           " hexahedra; give one label each");
    for (Eigen::Index n = 0; n < nodes.cols(); ++n)
        if (!nodes.col(n).allFinite())
            throw InvalidInput(who + "node " + std::to_string(n) + " has a coordinate that is not finite");
    for (int h = 0; h < cells.count(); ++h) {
        const std::string hex = who + "hexahedron " + std::to_string(h);
        for (const int node : cells.hexes.col(h))
            if (node < 0 || node >= nodes.cols())
                throw InvalidInput(hex + " uses node " + std::to_string(node) + "; the mesh has nodes 0 to " +
                                   std::to_string(nodes.cols() - 1));
        if (cells.labels[h] <= 0)
            throw InvalidInput(hex + " has label " + std::to_string(cells.labels[h]) + "; labels must be positive");
    }
    const Eigen::VectorXd jacobians = scaled_jacobians(nodes, cells);
    for (int h = 0; h < cells.count(); ++h)
        if (!(jacobians[h] > 0.0))
            throw InvalidInput(who + "hexahedron " + std::to_string(h) + " has a scaled Jacobian of " +
                               std::to_string(jacobians[h]) +
                               "; it must be positive: give corners in VTK's order, remove flat or folded elements");
}

}  // namespace tissuewarp::meshing
