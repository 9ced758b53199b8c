#include "meshing/primitives.hpp"
#include "meshing/quality.hpp"

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <cmath>
#include <numbers>

namespace tissuewarp::meshing {
namespace {

TetMesh single(const Eigen::Matrix<double, 3, 4>& corners) {
    TetMesh mesh;
    mesh.nodes = corners;
    mesh.tets = Eigen::Vector4i(0, 1, 2, 3);
    mesh.labels = Eigen::VectorXi::Ones(1);
    return mesh;
}

/// Edge 2 √2.
TetMesh regular_tetrahedron() {
    Eigen::Matrix<double, 3, 4> corners;
    corners << 1, 1, -1, -1, 1, -1, 1, -1, 1, -1, -1, 1;
    TetMesh mesh = single(corners);
    if (tet_volumes(mesh)[0] < 0.0) mesh.tets.col(0).tail<2>().reverseInPlace();
    return mesh;
}

TEST(Quality, OfTheRegularTetrahedron) {
    const QualityReport report = quality(regular_tetrahedron());
    const double edge = 2.0 * std::numbers::sqrt2;
    const double dihedral = std::acos(1.0 / 3.0) * 180.0 / std::numbers::pi;  // 70.53°
    EXPECT_NEAR(report.min_dihedral_deg.minimum, dihedral, 1e-10);
    EXPECT_NEAR(report.max_dihedral_deg.maximum, dihedral, 1e-10);
    EXPECT_NEAR(report.radius_edge.median, std::sqrt(6.0) / 4.0, 1e-12);  // 0.612
    EXPECT_NEAR(report.edge_mm.mean, edge, 1e-12);
    EXPECT_NEAR(report.volume_mm3.mean, edge * edge * edge / (6.0 * std::numbers::sqrt2), 1e-12);
    // |∇N| = 1 / height, height = edge √(2/3): Σ|∇N|² = 6 / edge².
    EXPECT_NEAR(report.step_limit_mm, edge / std::sqrt(6.0), 1e-12);
    EXPECT_EQ(report.components, 1);
}

TEST(Quality, OfTheCornerTetrahedron) {
    Eigen::Matrix<double, 3, 4> corners;
    corners << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
    const QualityReport report = quality(single(corners));
    EXPECT_NEAR(report.max_dihedral_deg.maximum, 90.0, 1e-10);
    EXPECT_NEAR(report.min_dihedral_deg.minimum, std::acos(1.0 / std::sqrt(3.0)) * 180.0 / std::numbers::pi, 1e-10);
    EXPECT_NEAR(report.radius_edge.maximum, std::sqrt(3.0) / 2.0, 1e-12);
    EXPECT_NEAR(report.step_limit_mm, 1.0 / std::sqrt(6.0), 1e-12);  // gradients −1−1−1, x, y, z
}

TEST(Quality, CountsLabelVolumesAndPiecesJoinedByFaces) {
    TetMesh mesh = box_mesh({2, 1, 1}, {2, 1, 1});
    for (int t = 0; t < mesh.tet_count(); ++t) mesh.labels[t] = t < 6 ? 3 : 9;
    QualityReport report = quality(mesh);
    EXPECT_NEAR(report.label_volume_mm3.at(3), 1.0, 1e-12);
    EXPECT_NEAR(report.label_volume_mm3.at(9), 1.0, 1e-12);
    EXPECT_EQ(report.components, 1);

    TetMesh apart = mesh;  // two cells with nodes of their own
    apart.nodes.conservativeResize(3, mesh.node_count() * 2);
    apart.nodes.rightCols(mesh.node_count()) = mesh.nodes;
    apart.tets.rightCols(6).array() += mesh.node_count();
    EXPECT_EQ(quality(apart).components, 2);
}

TEST(Quality, FindsTheStepLimitingElement) {
    TetMesh mesh = box_mesh({1, 1, 1}, {4, 4, 4});
    const int node = 2 + 5 * (2 + 5 * 2);
    mesh.nodes(0, node) += 0.22;  // nearly flattens tetrahedra beside it
    const QualityReport report = quality(mesh);
    ASSERT_GE(report.step_limiting_tet, 0);
    const auto tet = mesh.tets.col(report.step_limiting_tet);
    EXPECT_TRUE((tet.array() == node).any());
    EXPECT_LT(report.step_limit_mm, 0.5 * quality(box_mesh({1, 1, 1}, {4, 4, 4})).step_limit_mm);
}

TEST(Quality, DistributionsAreOrdered) {
    const QualityReport report = quality(box_mesh({1, 1, 1}, {5, 5, 5}, 0.15));
    for (const Distribution& d : {report.min_dihedral_deg, report.radius_edge, report.volume_mm3, report.edge_mm}) {
        EXPECT_LT(d.minimum, d.percentile_1);
        EXPECT_LT(d.percentile_1, d.median);
        EXPECT_LT(d.median, d.percentile_99);
        EXPECT_LT(d.percentile_99, d.maximum);
        EXPECT_GT(d.mean, d.percentile_1);
    }
}

}  // namespace
}  // namespace tissuewarp::meshing
