#include "tled/reference/quadratic.hpp"
#include "tled/reference/quadrature.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <set>

namespace tissuewarp::tled {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

constexpr int edges[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};

std::pair<int, int> edge_of(int a, int b) {
    return std::minmax(a, b);
}

std::set<std::pair<int, int>> interface_edges(const meshing::TetMesh& mesh) {
    std::set<std::pair<int, int>> result;
    for (const meshing::InterfaceFace& face : meshing::interface_faces(mesh)) {
        for (std::size_t k = 0; k < 3; ++k) result.insert(edge_of(face.nodes[k], face.nodes[(k + 1) % 3]));
    }
    return result;
}

// Shape functions of the six-node triangle: corners, then the middles of 01, 12, 20.
Eigen::Matrix<double, 6, 1> triangle_shape(const Vector3d& L) {
    Eigen::Matrix<double, 6, 1> N;
    for (int k = 0; k < 3; ++k) {
        N[k] = L[k] * (2.0 * L[k] - 1.0);
        N[3 + k] = 4.0 * L[k] * L[(k + 1) % 3];
    }
    return N;
}

// Derivatives by L_1 and L_2 with L_0 = 1 − L_1 − L_2.
Eigen::Matrix<double, 6, 2> triangle_shape_derivatives(const Vector3d& L) {
    Eigen::Matrix<double, 6, 3> by_L = Eigen::Matrix<double, 6, 3>::Zero();
    for (int k = 0; k < 3; ++k) {
        by_L(k, k) = 4.0 * L[k] - 1.0;
        by_L(3 + k, k) = 4.0 * L[(k + 1) % 3];
        by_L(3 + k, (k + 1) % 3) = 4.0 * L[k];
    }
    Eigen::Matrix<double, 6, 2> result;
    result << by_L.col(1) - by_L.col(0), by_L.col(2) - by_L.col(0);
    return result;
}

}  // namespace

QuadraticMesh quadratic_mesh(const meshing::TetMesh& mesh, const EdgeCurve& curve) {
    QuadraticMesh result;
    result.corner_count = mesh.node_count();
    result.labels = mesh.labels;
    result.tets.resize(10, mesh.tet_count());
    int count = mesh.node_count();
    for (int t = 0; t < mesh.tet_count(); ++t) {
        for (int c = 0; c < 4; ++c) result.tets(c, t) = mesh.tets(c, t);
        for (int k = 0; k < 6; ++k) {
            const auto edge = edge_of(mesh.tets(edges[k][0], t), mesh.tets(edges[k][1], t));
            const auto [place, is_new] = result.middle.emplace(edge, count);
            if (is_new) ++count;
            result.tets(4 + k, t) = place->second;
        }
    }
    result.nodes.resize(3, count);
    result.nodes.leftCols(mesh.node_count()) = mesh.nodes;
    for (const auto& [edge, node] : result.middle) {
        result.nodes.col(node) = 0.5 * (mesh.nodes.col(edge.first) + mesh.nodes.col(edge.second));
    }
    if (!curve) return result;
    for (const auto& edge : interface_edges(mesh)) {
        result.nodes.col(result.middle.at(edge)) = curve(mesh.nodes.col(edge.first), mesh.nodes.col(edge.second));
    }
    return result;
}

Eigen::Matrix<double, 10, 1> quadratic_shape(const Vector3d& local) {
    const Eigen::Vector4d L(1.0 - local.sum(), local[0], local[1], local[2]);
    Eigen::Matrix<double, 10, 1> N;
    for (int c = 0; c < 4; ++c) N[c] = L[c] * (2.0 * L[c] - 1.0);
    for (int k = 0; k < 6; ++k) N[4 + k] = 4.0 * L[edges[k][0]] * L[edges[k][1]];
    return N;
}

Eigen::Matrix<double, 10, 3> quadratic_shape_derivatives(const Vector3d& local) {
    const Eigen::Vector4d L(1.0 - local.sum(), local[0], local[1], local[2]);
    Eigen::Matrix<double, 10, 4> by_L = Eigen::Matrix<double, 10, 4>::Zero();
    for (int c = 0; c < 4; ++c) by_L(c, c) = 4.0 * L[c] - 1.0;
    for (int k = 0; k < 6; ++k) {
        by_L(4 + k, edges[k][0]) = 4.0 * L[edges[k][1]];
        by_L(4 + k, edges[k][1]) = 4.0 * L[edges[k][0]];
    }
    return by_L.rightCols<3>().colwise() - by_L.col(0);
}

Matrix3Xd body_load(const QuadraticMesh& mesh, const Vector3d& body_force) {
    Matrix3Xd load = Matrix3Xd::Zero(3, mesh.node_count());
    for (int t = 0; t < mesh.tet_count(); ++t) {
        Eigen::Matrix<double, 3, 10> X;
        for (int c = 0; c < 10; ++c) X.col(c) = mesh.nodes.col(mesh.tets(c, t));
        for (const detail::QuadraturePoint& point : detail::tetrahedron_rule(Quadrature::Points11)) {
            const double volume = point.weight * (X * quadratic_shape_derivatives(point.local)).determinant();
            const Eigen::Matrix<double, 10, 1> N = quadratic_shape(point.local);
            for (int c = 0; c < 10; ++c) load.col(mesh.tets(c, t)) += volume * N[c] * body_force;
        }
    }
    return load;
}

void add_traction(const QuadraticMesh& mesh, const std::array<int, 3>& face, const Vector3d& traction,
                  Matrix3Xd& load) {
    std::array<int, 6> nodes{};
    for (std::size_t k = 0; k < 3; ++k) {
        nodes[k] = face[k];
        nodes[3 + k] = mesh.middle.at(edge_of(face[k], face[(k + 1) % 3]));
    }
    Eigen::Matrix<double, 3, 6> X;
    for (int k = 0; k < 6; ++k) X.col(k) = mesh.nodes.col(nodes[static_cast<std::size_t>(k)]);
    for (const detail::TrianglePoint& point : detail::triangle_rule()) {
        const Eigen::Matrix<double, 3, 2> tangents = X * triangle_shape_derivatives(point.barycentric);
        const double area = point.weight * Vector3d(tangents.col(0)).cross(Vector3d(tangents.col(1))).norm();
        const Eigen::Matrix<double, 6, 1> N = triangle_shape(point.barycentric);
        for (int k = 0; k < 6; ++k) load.col(nodes[static_cast<std::size_t>(k)]) += area * N[k] * traction;
    }
}

}  // namespace tissuewarp::tled
