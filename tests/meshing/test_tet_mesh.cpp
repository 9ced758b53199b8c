#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "meshing/tet_mesh.hpp"

#include <gmock/gmock.h>
#include <Eigen/Dense>

#include <limits>
#include <set>

namespace tissuewarp::meshing {
namespace {

/// Lower half (in z) label 2, upper half label 5.
TetMesh two_label_box(int n) {
    TetMesh mesh = box_mesh({1, 1, 1}, {n, n, n});
    for (int t = 0; t < mesh.tet_count(); ++t) {
        const Eigen::Matrix<double, 3, 4> corners = mesh.nodes(Eigen::all, mesh.tets.col(t));
        mesh.labels[t] = corners.row(2).mean() < 0.5 ? 2 : 5;
    }
    return mesh;
}

Eigen::Vector3d area_vector(const TetMesh& mesh, const std::array<int, 3>& nodes) {
    const Eigen::Vector3d a = mesh.nodes.col(nodes[1]) - mesh.nodes.col(nodes[0]);
    const Eigen::Vector3d b = mesh.nodes.col(nodes[2]) - mesh.nodes.col(nodes[0]);
    return 0.5 * a.cross(b);
}

TEST(BoxMesh, FillsTheBoxWithPositiveTetrahedra) {
    const TetMesh mesh = box_mesh({2, 3, 5}, {2, 3, 4});
    EXPECT_EQ(mesh.tet_count(), 6 * 2 * 3 * 4);
    EXPECT_EQ(mesh.node_count(), 3 * 4 * 5);
    const Eigen::VectorXd volumes = tet_volumes(mesh);
    EXPECT_NEAR(volumes.minCoeff(), 30.0 / 144.0, 1e-12);
    EXPECT_NEAR(volumes.sum(), 30.0, 1e-12);
}

TEST(BoxMesh, JitterMovesOnlyTheInteriorAndKeepsTheVolume) {
    const TetMesh straight = box_mesh({1, 1, 1}, {4, 4, 4}), jittered = box_mesh({1, 1, 1}, {4, 4, 4}, 0.16, 3);
    EXPECT_NEAR(tet_volumes(jittered).sum(), 1.0, 1e-12);
    EXPECT_GT(tet_volumes(jittered).minCoeff(), 0.0);
    int moved = 0;
    for (int n = 0; n < straight.node_count(); ++n) {
        const Eigen::Vector3d x = straight.nodes.col(n);
        const bool interior = x.minCoeff() > 0.0 && x.maxCoeff() < 1.0;
        const double distance = (jittered.nodes.col(n) - x).norm();
        EXPECT_TRUE(interior || distance == 0.0) << "boundary node " << n;
        moved += distance > 0.0;
    }
    EXPECT_EQ(moved, 27);
}

TEST(BoxMesh, JitterDependsOnTheSeedAlone) {
    EXPECT_EQ(box_mesh({1, 1, 1}, {3, 3, 3}, 0.1, 7).nodes, box_mesh({1, 1, 1}, {3, 3, 3}, 0.1, 7).nodes);
    EXPECT_NE(box_mesh({1, 1, 1}, {3, 3, 3}, 0.1, 7).nodes, box_mesh({1, 1, 1}, {3, 3, 3}, 0.1, 8).nodes);
}

TEST(BoxMesh, CellsLieBetweenTheGivenPlanes) {
    const TetMesh mesh = box_mesh({{{0.0, 1.0, 4.0}, {-2.0, 3.0}, {5.0, 6.0, 8.0, 12.0}}});
    EXPECT_EQ(mesh.tet_count(), 6 * 2 * 1 * 3);
    EXPECT_EQ(mesh.nodes.col(1 + 3 * (1 + 2 * 2)), Eigen::Vector3d(1.0, 3.0, 8.0));
    EXPECT_NEAR(tet_volumes(mesh).minCoeff(), 5.0 / 6.0, 1e-12);
    EXPECT_NEAR(tet_volumes(mesh).sum(), 4.0 * 5.0 * 7.0, 1e-12);
    EXPECT_THROW(box_mesh({{{0.0, 1.0}, {0.0}, {0.0, 1.0}}}), InvalidInput);
    EXPECT_THROW(box_mesh({{{0.0, 1.0}, {0.0, 0.0}, {0.0, 1.0}}}), InvalidInput);
}

TEST(BoxMesh, RefusesEmptyBoxesAndInvertingJitter) {
    EXPECT_THROW(box_mesh({0, 1, 1}, {1, 1, 1}), InvalidInput);
    EXPECT_THROW(box_mesh({1, 1, 1}, {1, 0, 1}), InvalidInput);
    EXPECT_THROW(box_mesh({1, 1, 1}, {8, 8, 8}, 2.0), InvalidInput);
}

TEST(BoundarySurface, OfABoxIsClosedAndPointsOutward) {
    const int n = 4;
    const TetMesh mesh = box_mesh({1, 1, 1}, {n, n, n}, 0.1);
    const BoundarySurface boundary = boundary_surface(mesh);
    const SurfaceMesh& surface = boundary.surface;
    EXPECT_EQ(surface.triangle_count(), 12 * n * n);
    EXPECT_EQ(surface.node_count(), 6 * n * n + 2);  // Euler: V = F/2 + 2
    // Divergence theorem: ∮ x·n dA = 3 V for outward normals.
    double flux = 0.0;
    for (int f = 0; f < surface.triangle_count(); ++f) {
        const Eigen::Matrix3d x = surface.nodes(Eigen::all, surface.triangles.col(f));
        const Eigen::Vector3d area = 0.5 * (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0));
        flux += area.dot(x.rowwise().mean());
    }
    EXPECT_NEAR(flux, 3.0, 1e-12);
    for (int k = 0; k < surface.node_count(); ++k)
        EXPECT_EQ(surface.nodes.col(k), mesh.nodes.col(boundary.node_of[static_cast<std::size_t>(k)]));
}

TEST(NodeNormals, OfABoxFaceArePerpendicularToIt) {
    const BoundarySurface boundary = boundary_surface(box_mesh({1, 1, 1}, {4, 4, 4}));
    const Eigen::Matrix3Xd normals = node_normals(boundary.surface);
    int inside_top = 0;
    for (int k = 0; k < boundary.surface.node_count(); ++k) {
        const Eigen::Vector3d x = boundary.surface.nodes.col(k);
        EXPECT_NEAR(normals.col(k).norm(), 1.0, 1e-12);
        if (x[2] < 1.0 || x.head<2>().minCoeff() == 0.0 || x.head<2>().maxCoeff() == 1.0) continue;
        ++inside_top;
        EXPECT_NEAR((normals.col(k) - Eigen::Vector3d::UnitZ()).norm(), 0.0, 1e-12);
    }
    EXPECT_EQ(inside_top, 9);
}

TEST(NodeNormals, AreZeroWithoutTriangles) {
    SurfaceMesh cloud;
    cloud.nodes = Eigen::Matrix3Xd::Random(3, 4);
    cloud.triangles.resize(3, 0);
    EXPECT_EQ(node_normals(cloud), Eigen::Matrix3Xd(Eigen::Matrix3Xd::Zero(3, 4)));
}

TEST(InterfaceFaces, OfTwoLabelsAreSeparatedByTheirPlane) {
    const int n = 4;
    const TetMesh mesh = two_label_box(n);
    Eigen::Vector3d inner_area = Eigen::Vector3d::Zero();
    int between = 0, outside = 0;
    for (const InterfaceFace& face : interface_faces(mesh)) {
        if (face.outer != 0) {
            EXPECT_EQ(face.inner, 5);  // the larger label, above
            EXPECT_EQ(face.outer, 2);
            for (int node : face.nodes) EXPECT_EQ(mesh.nodes(2, node), 0.5);
            inner_area += area_vector(mesh, face.nodes);
            ++between;
        } else {
            ++outside;
        }
    }
    EXPECT_EQ(between, 2 * n * n);
    EXPECT_EQ(outside, 12 * n * n);
    EXPECT_NEAR((inner_area - Eigen::Vector3d(0, 0, -1)).norm(), 0.0, 1e-12);  // from 5 (above) down to 2
}

TEST(InterfaceFaces, AreSortedAndUnique) {
    const auto faces = interface_faces(two_label_box(3));
    for (std::size_t f = 1; f < faces.size(); ++f) {
        const auto& a = faces[f - 1];
        const auto& b = faces[f];
        EXPECT_LT(std::tie(a.inner, a.outer, a.nodes), std::tie(b.inner, b.outer, b.nodes));
    }
}

TEST(InterfaceFaces, RefuseAFaceOfThreeTetrahedra) {
    TetMesh mesh;
    mesh.nodes.resize(3, 6);
    mesh.nodes << 0, 1, 0, 0, 0.3, 0.2, 0, 0, 1, 0, 0.3, 0.2, 0, 0, 0, 1, 1, 2;
    mesh.tets.resize(4, 3);
    mesh.tets << 0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 4, 5;
    mesh.labels = Eigen::Vector3i::Ones();
    EXPECT_THROW(interface_faces(mesh), InvalidInput);
}

TEST(RequireValid, AcceptsABoxAndNamesWhatIsWrong) {
    const TetMesh good = box_mesh({1, 1, 1}, {2, 2, 2});
    EXPECT_NO_THROW(require_valid(good, "box"));
    const auto message = [](const TetMesh& mesh) -> std::string {
        try {
            require_valid(mesh, "box");
        } catch (const InvalidInput& error) {
            return error.what();
        }
        return "accepted";
    };
    TetMesh bad = good;
    bad.tets(2, 5) = 27;
    EXPECT_THAT(message(bad), testing::HasSubstr("tetrahedron 5 uses node 27"));
    bad = good;
    bad.nodes(1, 3) = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THAT(message(bad), testing::HasSubstr("node 3"));
    bad = good;
    bad.tets.col(7).row(0).swap(bad.tets.col(7).row(1));
    EXPECT_THAT(message(bad), testing::HasSubstr("tetrahedron 7 has volume -"));
    bad = good;
    bad.labels[1] = 0;
    EXPECT_THAT(message(bad), testing::HasSubstr("tetrahedron 1 has label 0"));
    bad = good;
    bad.labels.conservativeResize(3);
    EXPECT_THAT(message(bad), testing::HasSubstr("3 labels for 48"));
    EXPECT_THAT(message(TetMesh{}), testing::HasSubstr("no tetrahedra"));
}

}  // namespace
}  // namespace tissuewarp::meshing
