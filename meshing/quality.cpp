#include "meshing/quality.hpp"

#include "meshing/detail/faces.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <vector>

namespace tissuewarp::meshing {

namespace {

/// Outward area vectors of the faces opposite to the corners, 3 × 4, mm².
using AreaVectors = Eigen::Matrix<double, 3, 4>;

AreaVectors area_vectors(const TetMesh& mesh, int t) {
    AreaVectors areas;
    for (int corner = 0; corner < 4; ++corner) {
        const auto& c = detail::face_corners[corner];
        const Eigen::Vector3d origin = mesh.nodes.col(mesh.tets(c[0], t));
        const Eigen::Vector3d a = mesh.nodes.col(mesh.tets(c[1], t)) - origin;
        const Eigen::Vector3d b = mesh.nodes.col(mesh.tets(c[2], t)) - origin;
        areas.col(corner) = 0.5 * a.cross(b);
    }
    return areas;
}

Distribution distribution(std::vector<double> values) {
    if (values.empty()) return {};
    std::sort(values.begin(), values.end());
    const auto at = [&](double fraction) {
        return values[static_cast<std::size_t>(std::lround(fraction * static_cast<double>(values.size() - 1)))];
    };
    const double sum = std::accumulate(values.begin(), values.end(), 0.0);
    return {values.front(), at(0.01), at(0.5), at(0.99), values.back(), sum / static_cast<double>(values.size())};
}

/// Circumradius over shortest edge. The circumcentre follows from equal distances to the four corners.
double radius_edge(const TetMesh& mesh, int t, double volume) {
    const Eigen::Vector3d origin = mesh.nodes.col(mesh.tets(0, t));
    const Eigen::Vector3d a = mesh.nodes.col(mesh.tets(1, t)) - origin;
    const Eigen::Vector3d b = mesh.nodes.col(mesh.tets(2, t)) - origin;
    const Eigen::Vector3d c = mesh.nodes.col(mesh.tets(3, t)) - origin;
    const Eigen::Vector3d numerator =
        a.squaredNorm() * b.cross(c) + b.squaredNorm() * c.cross(a) + c.squaredNorm() * a.cross(b);
    const double shortest = std::sqrt(std::min({a.squaredNorm(), b.squaredNorm(), c.squaredNorm(),
                                                (a - b).squaredNorm(), (b - c).squaredNorm(), (c - a).squaredNorm()}));
    return numerator.norm() / (12.0 * volume) / shortest;
}

int face_connected_components(const TetMesh& mesh) {
    std::vector<int> parent(static_cast<std::size_t>(mesh.tet_count()));
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](int t) {
        while (parent[static_cast<std::size_t>(t)] != t) {
            auto& up = parent[static_cast<std::size_t>(t)];
            up = parent[static_cast<std::size_t>(up)];
            t = up;
        }
        return t;
    };
    int components = mesh.tet_count();
    detail::for_each_face(detail::sorted_faces(mesh), [&](const detail::TetFace& a, const detail::TetFace* b) {
        if (!b) return;
        const int first = root(a.tet), second = root(b->tet);
        if (first == second) return;
        parent[static_cast<std::size_t>(second)] = first;
        --components;
    });
    return components;
}

std::vector<double> edge_lengths(const TetMesh& mesh) {
    const auto edges = detail::unique_edges(mesh);
    std::vector<double> lengths(edges.size());
    std::transform(edges.begin(), edges.end(), lengths.begin(), [&](const std::array<int, 2>& edge) {
        return (mesh.nodes.col(edge[0]) - mesh.nodes.col(edge[1])).norm();
    });
    return lengths;
}

std::vector<double> to_vector(const Eigen::VectorXd& values) {
    return {values.begin(), values.end()};
}

}  // namespace

Eigen::Matrix2Xd dihedral_angles(const TetMesh& mesh) {
    Eigen::Matrix2Xd angles(2, mesh.tet_count());
    for (int t = 0; t < mesh.tet_count(); ++t) {
        const AreaVectors areas = area_vectors(mesh, t);
        double smallest = std::numeric_limits<double>::infinity(), largest = 0.0;
        for (const auto& [i, j] : detail::edge_corners) {
            const Eigen::Vector3d a = areas.col(i), b = areas.col(j);
            const double angle = std::atan2(a.cross(b).norm(), -a.dot(b));
            smallest = std::min(smallest, angle);
            largest = std::max(largest, angle);
        }
        angles.col(t) << smallest, largest;
    }
    return angles * (180.0 / std::numbers::pi);
}

QualityReport quality(const TetMesh& mesh) {
    require_valid(mesh, "quality");
    QualityReport report;
    const Eigen::VectorXd volumes = tet_volumes(mesh);
    const Eigen::Matrix2Xd angles = dihedral_angles(mesh);
    std::vector<double> ratios(static_cast<std::size_t>(mesh.tet_count()));
    double largest_gradients = 0.0;  // Σ|∇N|², 1/mm²
    for (int t = 0; t < mesh.tet_count(); ++t) {
        ratios[static_cast<std::size_t>(t)] = radius_edge(mesh, t, volumes[t]);
        report.label_volume_mm3[mesh.labels[t]] += volumes[t];
        // |∇N_k| = A_k / (3 V), with A_k the area of the face opposite to node k.
        const double gradients = area_vectors(mesh, t).squaredNorm() / (9.0 * volumes[t] * volumes[t]);
        if (gradients > largest_gradients) {
            largest_gradients = gradients;
            report.step_limiting_tet = t;
        }
    }
    report.min_dihedral_deg = distribution(to_vector(angles.row(0)));
    report.max_dihedral_deg = distribution(to_vector(angles.row(1)));
    report.radius_edge = distribution(std::move(ratios));
    report.volume_mm3 = distribution(to_vector(volumes));
    report.edge_mm = distribution(edge_lengths(mesh));
    report.step_limit_mm = 1.0 / std::sqrt(largest_gradients);
    report.components = face_connected_components(mesh);
    return report;
}

}  // namespace tissuewarp::meshing
