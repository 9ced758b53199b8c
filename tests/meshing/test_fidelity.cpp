#include "label_shapes.hpp"
#include "meshing/detail/triangle_distance.hpp"
#include "meshing/mesher.hpp"
#include "meshing/primitives.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace tissuewarp::meshing {
namespace {

/// A box of 8 × 8 × 8 voxels that box_mesh reproduces exactly once shifted.
imaging::Volume voxel_box() {
    return paint(grid(16), [](const Eigen::Vector3d& p) { return p.minCoeff() > 3.5 && p.maxCoeff() < 11.5 ? 1 : 0; });
}

TetMesh matching_box() {
    TetMesh mesh = box_mesh({8, 8, 8}, {4, 4, 4});
    mesh.nodes.array() += 3.5;
    return mesh;
}

TEST(Fidelity, OfAnExactMeshIsPerfect) {
    const Fidelity result = fidelity(matching_box(), voxel_box());
    EXPECT_NEAR(result.volume_ratio.at(1), 1.0, 1e-12);
    EXPECT_NEAR(result.mean_surface_distance_mm, 0.0, 1e-12);
    EXPECT_NEAR(result.hausdorff_mm, 0.0, 1e-12);
}

TEST(Fidelity, SeesAShiftAsItsLength) {
    TetMesh mesh = matching_box();
    mesh.nodes.row(0).array() += 1.5;
    const Fidelity result = fidelity(mesh, voxel_box());
    EXPECT_NEAR(result.volume_ratio.at(1), 1.0, 1e-12);
    EXPECT_NEAR(result.hausdorff_mm, 1.5, 1e-12);
    // Two of six faces lie 1.5 mm off; the strips of the others that stick out add less than their share of area.
    EXPECT_GT(result.mean_surface_distance_mm, 1.5 / 3.0);
    EXPECT_LT(result.mean_surface_distance_mm, 1.5 / 3.0 + 0.15);
}

TEST(Fidelity, SeesAMissingPiece) {
    imaging::Volume labels = voxel_box();
    labels.data<int>()[labels.offset(14, 14, 14)] = 1;
    const Fidelity result = fidelity(matching_box(), labels);
    EXPECT_NEAR(result.volume_ratio.at(1), 512.0 / 513.0, 1e-12);
    // Farthest face centre of the lone voxel from the corner (11.5, 11.5, 11.5) of the box: (14.5, 14, 14).
    EXPECT_NEAR(result.hausdorff_mm, Eigen::Vector3d(3.0, 2.5, 2.5).norm(), 1e-12);
}

TEST(Fidelity, RatioOfAMissingLabelIsZero) {
    imaging::Volume labels = voxel_box();
    labels.data<int>()[0] = 2;
    EXPECT_EQ(fidelity(matching_box(), labels).volume_ratio.at(2), 0.0);
}

TEST(TriangleDistance, ToFaceEdgeAndCorner) {
    const detail::Triangle triangle{Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(2, 0, 0), Eigen::Vector3d(0, 2, 0)};
    EXPECT_NEAR(detail::distance({0.5, 0.5, -3}, triangle), 3.0, 1e-14);
    EXPECT_NEAR(detail::distance({1, -2, 0}, triangle), 2.0, 1e-14);
    EXPECT_NEAR(detail::distance({-3, -4, 0}, triangle), 5.0, 1e-14);
    EXPECT_NEAR(detail::distance({2, 2, 1}, triangle), std::sqrt(3.0), 1e-14);
    EXPECT_NEAR(detail::distance({5, -4, 0}, triangle), 5.0, 1e-14);
}

TEST(TriangleDistance, GridAgreesWithExhaustiveSearch) {
    const TetMesh mesh = box_mesh({3, 2, 1}, {4, 3, 2}, 0.1);
    std::vector<detail::Triangle> triangles;
    for (const InterfaceFace& face : interface_faces(mesh))
        triangles.push_back(
            {mesh.nodes.col(face.nodes[0]), mesh.nodes.col(face.nodes[1]), mesh.nodes.col(face.nodes[2])});
    const detail::TriangleDistance nearest(triangles, 0.3);
    std::srand(3);
    for (int trial = 0; trial < 300; ++trial) {
        const Eigen::Vector3d point = 6.0 * Eigen::Vector3d::Random();
        double expected = std::numeric_limits<double>::infinity();
        for (const auto& triangle : triangles) expected = std::min(expected, detail::distance(point, triangle));
        ASSERT_NEAR(nearest(point), expected, 1e-13);
    }
}

}  // namespace
}  // namespace tissuewarp::meshing
