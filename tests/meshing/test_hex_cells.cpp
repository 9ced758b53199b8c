#include "core/errors.hpp"
#include "meshing/hex_primitives.hpp"
#include "meshing/mesh_io.hpp"
#include "scratch_folder.hpp"

#include <gmock/gmock.h>
#include <Eigen/Dense>

#include <algorithm>
#include <cstdlib>
#include <limits>

namespace tissuewarp::meshing {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

MixedMesh stepped_box() {
    MixedMesh box = mixed_box(
        {30, 20, 24}, {3, 2, 2}, [](int i, int j, int k) { return (i + j + k) % 2 == 0; }, 0.12);
    for (int h = 0; h < box.hexahedra.count(); ++h) box.hexahedra.labels[h] = 5 + h;
    return box;
}

TEST(HexCells, BoxIsFilledByPositiveHexahedra) {
    const MixedMesh box = box_hexes({30, 20, 24}, {3, 2, 4});
    ASSERT_EQ(box.hexahedra.count(), 24);
    EXPECT_EQ(box.mesh.tet_count(), 0);
    const Eigen::VectorXd volumes = hex_volumes(box.mesh.nodes, box.hexahedra);
    EXPECT_LT((volumes.array() - 600.0).abs().maxCoeff(), 1e-10);
    EXPECT_LT((scaled_jacobians(box.mesh.nodes, box.hexahedra).array() - 1.0).abs().maxCoeff(), 1e-12);
    const MixedMesh jittered = box_hexes({30, 20, 24}, {3, 2, 4}, 0.15);
    EXPECT_NEAR(hex_volumes(jittered.mesh.nodes, jittered.hexahedra).sum(), 14400.0, 1e-9);
    EXPECT_LT(scaled_jacobians(jittered.mesh.nodes, jittered.hexahedra).maxCoeff(), 1.0);
}

TEST(HexCells, MixedBoxSharesNodesAndFillsTheBox) {
    const MixedMesh box = stepped_box();
    ASSERT_EQ(box.hexahedra.count(), 6);
    ASSERT_EQ(box.mesh.tet_count(), 36);
    const std::vector<FaceShapes> shapes = face_shapes(box.mesh, box.hexahedra);
    double volume = tet_volumes(box.mesh).sum();
    int cut = 0;
    for (int h = 0; h < 6; ++h) {
        const HexCorners X = hex_corners(box.mesh.nodes, box.hexahedra, h);
        const FaceShapes& faces = shapes[static_cast<std::size_t>(h)];
        volume += surface_gradient(X, faces).cwiseProduct(X).sum() / 3;
        for (const FaceShape shape : faces) cut += shape != FaceShape::Bilinear;
    }
    EXPECT_EQ(cut, 20);  // every face between two cells of the checkerboard
    EXPECT_NEAR(volume, 14400.0, 1e-9);
}

TEST(HexCells, SurfaceGradientIsExactForLinearFields) {
    const MixedMesh box = stepped_box();
    const std::vector<FaceShapes> shapes = face_shapes(box.mesh, box.hexahedra);
    for (int h = 0; h < box.hexahedra.count(); ++h) {
        const HexCorners X = hex_corners(box.mesh.nodes, box.hexahedra, h);
        for (const FaceShapes& faces : {FaceShapes{}, shapes[static_cast<std::size_t>(h)]}) {
            const HexCorners B = surface_gradient(X, faces);
            const Matrix3d moment = B * X.transpose();
            const double volume = moment.trace() / 3;
            EXPECT_GT(volume, 800.0);
            EXPECT_LT((moment - volume * Matrix3d::Identity()).norm(), 1e-10 * volume);
            EXPECT_LT(B.rowwise().sum().norm(), 1e-11);
        }
    }
}

// Bilinear faces: B is the gradient of the volume by the corners.
TEST(HexCells, SurfaceGradientIsThatOfTheVolume) {
    const MixedMesh box = box_hexes({30, 20, 24}, {2, 2, 2}, 0.15);
    const HexCorners X = hex_corners(box.mesh.nodes, box.hexahedra, 3);
    const auto volume = [](const HexCorners& x) { return surface_gradient(x).cwiseProduct(x).sum() / 3; };
    const HexCorners B = surface_gradient(X);
    for (int i = 0; i < 24; ++i) {
        HexCorners up = X, down = X;
        up.data()[i] += 1e-3;
        down.data()[i] -= 1e-3;
        EXPECT_NEAR(B.data()[i], (volume(up) - volume(down)) / 2e-3, 1e-7 * B.norm());
    }
}

/// Largest resultant at an inner node over the largest force of a hexahedron on a corner, for a stress of 1 kPa.
double imbalance(const MixedMesh& box, const std::vector<FaceShapes>& shapes) {
    Eigen::Matrix3Xd force = Eigen::Matrix3Xd::Zero(3, box.mesh.node_count());
    double largest = 0.0;
    for (int h = 0; h < box.hexahedra.count(); ++h) {
        const HexCorners B =
            surface_gradient(hex_corners(box.mesh.nodes, box.hexahedra, h), shapes[static_cast<std::size_t>(h)]);
        for (int c = 0; c < 8; ++c) force.col(box.hexahedra.hexes(c, h)) += B.col(c);
        largest = std::max(largest, B.colwise().norm().maxCoeff());
    }
    for (int t = 0; t < box.mesh.tet_count(); ++t) {
        const Eigen::Vector4i n = box.mesh.tets.col(t);
        Matrix3d edges;
        for (int k = 0; k < 3; ++k) edges.col(k) = box.mesh.nodes.col(n[k + 1]) - box.mesh.nodes.col(n[0]);
        const Matrix3d B = edges.determinant() / 6 * edges.inverse().transpose();  // V ∇N of corners 1 to 3
        for (int k = 0; k < 3; ++k) force.col(n[k + 1]) += B.col(k);
        force.col(n[0]) -= B.rowwise().sum();
    }
    double worst = 0.0;
    for (int i = 0; i < box.mesh.node_count(); ++i) {
        const Eigen::Array3d x = box.mesh.nodes.col(i);
        const bool inside = (x > 1e-9).all() && (x < Eigen::Array3d(30, 20, 24) - 1e-9).all();
        if (inside) worst = std::max(worst, force.col(i).norm());
    }
    return worst / largest;
}

TEST(HexCells, OnlyCommonFacesBalanceAHomogeneousStress) {
    const auto is_hexahedron = [](int i, int j, int k) { return (i + j + k) % 3 != 1; };
    for (const double jitter : {0.0, 0.12}) {
        const MixedMesh box = mixed_box({30, 20, 24}, {3, 2, 2}, is_hexahedron, jitter, 7);
        EXPECT_LT(imbalance(box, face_shapes(box.mesh, box.hexahedra)), 1e-13);
        const std::vector<FaceShapes> bilinear(static_cast<std::size_t>(box.hexahedra.count()));
        EXPECT_NEAR(imbalance(box, bilinear), 1.0, 0.2);
    }
}

TEST(HexCells, WrongCellsAreNamed) {
    const auto refused = [](const MixedMesh& box, const char* cause) {
        EXPECT_THAT([&] { require_valid(box.mesh.nodes, box.hexahedra, "box"); },
                    ::testing::ThrowsMessage<InvalidInput>(::testing::HasSubstr(cause)));
    };
    const MixedMesh good = box_hexes({30, 20, 24}, {2, 1, 1});
    MixedMesh box = good;
    box.hexahedra.hexes(0, 1) = 99;
    refused(box, "hexahedron 1 uses node 99");
    box = good;
    box.hexahedra.labels[0] = 0;
    refused(box, "hexahedron 0 has label 0");
    box = good;
    box.hexahedra.hexes.col(1).head<4>().reverseInPlace();
    refused(box, "hexahedron 1 has a scaled Jacobian");
    box = good;
    box.mesh.nodes.row(2).setZero();
    refused(box, "hexahedron 0 has a scaled Jacobian of 0");
    box = good;
    box.mesh.nodes(0, 3) = std::numeric_limits<double>::quiet_NaN();
    refused(box, "node 3 has a coordinate");
    box = good;
    box.hexahedra.labels.resize(1);
    refused(box, "1 labels for 2 hexahedra");
}

using MixedVtu = ScratchFolder;

TEST_F(MixedVtu, RoundTripIsExact) {
    const MixedMesh box = stepped_box();
    write_vtu(box, file("mixed.vtu"), {}, {{"jacobian", Eigen::MatrixXd::Random(1, 42)}});
    const MixedMesh again = read_mixed_vtu(file("mixed.vtu"));
    EXPECT_EQ(again.mesh.nodes, box.mesh.nodes);
    EXPECT_EQ(again.mesh.tets, box.mesh.tets);
    EXPECT_EQ(again.mesh.labels, box.mesh.labels);
    EXPECT_EQ(again.hexahedra.hexes, box.hexahedra.hexes);
    EXPECT_EQ(again.hexahedra.labels, box.hexahedra.labels);
    EXPECT_THAT([&] { read_vtu(file("mixed.vtu")); },
                ::testing::ThrowsMessage<InvalidInput>(::testing::HasSubstr("VTK type 12")));
}

TEST_F(MixedVtu, HexahedraAloneAreReadByAnotherProgramToo) {
    const MixedMesh box = box_hexes({30, 20, 24}, {2, 2, 1});
    write_vtu(box, file("hexes.vtu"));
    EXPECT_EQ(read_mixed_vtu(file("hexes.vtu")).hexahedra.hexes, box.hexahedra.hexes);
    if (std::system("/usr/bin/python3 -c 'import meshio' 2>/dev/null") != 0) GTEST_SKIP() << "no meshio";
    const std::string script = "import meshio; m = meshio.read('" + file("hexes.vtu").string() +
                               "'); c = m.cells_dict['hexahedron']; assert c.shape == (4, 8) and c[3][6] == 17, c";
    EXPECT_EQ(std::system(("/usr/bin/python3 -c \"" + script + "\"").c_str()), 0);
}

}  // namespace
}  // namespace tissuewarp::meshing
