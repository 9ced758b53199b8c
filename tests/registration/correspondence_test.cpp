/// Sub-voxel boundaries from voxel labels, and interface nodes with their normals.
#include "registration/correspondence.hpp"

#include "core/errors.hpp"

#include "meshing/primitives.hpp"
#include "tests/support/label_shapes.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::registration {
namespace {

using Eigen::Vector3d;

const shapes::Organ ball_organ{{0, 0, 0}, {40, 40, 40}, {0, 0, 0}, 15};

TEST(LabelBoundaryField, CrossingOfABallIsSubVoxel) {
    const LabelBoundaryField field(shapes::organ_labels(ball_organ, Eigen::Isometry3d::Identity(), 1.0), {1, 2}, 1.0);
    for (int i = 0; i < 50; ++i) {
        const Vector3d n = Vector3d(std::sin(1.0 + i), std::cos(2.3 * i), std::sin(0.7 * i)).normalized();
        EXPECT_NEAR(field.crossing(37 * n, n, 1, 0, 10, 45), 3.0, 0.35) << i;   // ahead
        EXPECT_NEAR(field.crossing(44 * n, n, 1, 0, 10, 45), -4.0, 0.35) << i;  // behind
        EXPECT_NEAR(field.crossing(17 * n, n, 2, 1, 10, 45), -2.0, 0.35) << i;  // inner interface
    }
}

TEST(LabelBoundaryField, NothingBeyondTheRange) {
    const LabelBoundaryField field(shapes::organ_labels(ball_organ), {1, 2});
    EXPECT_TRUE(std::isnan(field.crossing({30, 0, 0}, {1, 0, 0}, 1, 0, 5, 45)));
}

TEST(LabelBoundaryField, ASurfaceFacingAwayIsNotMatched) {
    const LabelBoundaryField field(shapes::organ_labels(ball_organ), {1, 2});
    EXPECT_TRUE(std::isnan(field.crossing({39, 0, 0}, {-1, 0, 0}, 1, 0, 6, 45)));  // normal reversed
    const Vector3d oblique = Vector3d(1, 2, 0).normalized();                       // 63° off
    EXPECT_TRUE(std::isnan(field.crossing(Vector3d(40, 0, 0) - oblique, oblique, 1, 0, 6, 45)));
}

TEST(LabelBoundaryField, UnknownLabelsHaveNoBoundary) {
    const LabelBoundaryField field(shapes::organ_labels(ball_organ), {1});
    EXPECT_TRUE(std::isnan(field.crossing({15, 0, 0}, {1, 0, 0}, 2, 1, 6, 45)));
}

TEST(LabelBoundaryField, AnEmptyMapIsRefused) {
    auto labels = shapes::organ_labels(ball_organ);
    labels.voxels.setTo(0);
    EXPECT_THROW(LabelBoundaryField(labels, {1}), InvalidInput);
}

TEST(Interfaces, OfTwoBlocks) {
    auto mesh = meshing::box_mesh({20, 10, 10}, {4, 2, 2});
    for (int t = 0; t < mesh.tet_count(); ++t) {
        double x = 0;
        for (const int node : mesh.tets.col(t)) x += mesh.nodes(0, node) / 4;
        mesh.labels[t] = x < 10 ? 1 : 2;
    }
    const Interfaces interfaces(mesh);
    double inner_area = 0, outer_area = 0;
    for (const InterfaceNode& node : interfaces.nodes()) {
        (node.outer == 0 ? outer_area : inner_area) += node.area;
        if (node.outer == 0) continue;
        EXPECT_EQ(node.inner, 2);
        EXPECT_EQ(node.outer, 1);
        EXPECT_NEAR((node.normal - Vector3d(-1, 0, 0)).norm(), 0, 1e-12);  // from 2 into 1
        EXPECT_NEAR(mesh.nodes(0, node.node), 10, 1e-12);
    }
    EXPECT_NEAR(inner_area, 100, 1e-9);
    EXPECT_NEAR(outer_area, 4 * 200 + 2 * 100, 1e-9);
}

TEST(Interfaces, NormalsTurnWithTheMesh) {
    const auto mesh = meshing::box_mesh({20, 10, 10}, {4, 2, 2});
    const Interfaces interfaces(mesh);
    const Eigen::Isometry3d motion = shapes::motion(40, {1, 2, 3}, {5, 6, 7});
    const Eigen::Matrix3Xd turned = interfaces.normals(motion * mesh.nodes);
    for (std::size_t i = 0; i < interfaces.nodes().size(); ++i)
        EXPECT_NEAR((turned.col(static_cast<Eigen::Index>(i)) - motion.linear() * interfaces.nodes()[i].normal).norm(),
                    0, 1e-12);
}

}  // namespace
}  // namespace tissuewarp::registration
