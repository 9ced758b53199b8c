/// What holds tissue of which no datum says where it went.
#include "registration/springs/ground_springs.hpp"

#include "tests/support/label_shapes.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::registration::detail {
namespace {

PreparedModel ellipsoid() {
    shapes::Organ organ;
    organ.inclusion_radius = 0;
    PrepareOptions options;
    options.meshing.edge_length = 12;
    return prepare(shapes::organ_labels(organ, Eigen::Isometry3d::Identity(), 3), options);
}

double force(const tled::Spring& spring, const Eigen::Vector3d& direction) {
    return direction.dot(spring.stiffness * direction);
}

// Axes that are swapped, or deviations taken for stiffnesses, change the ratio of what holds across and along.
TEST(Ground, HoldsASurfaceAcrossAndLetsItSlide) {
    const PreparedModel prepared = ellipsoid();
    const double energy = 5, across = 0.5, along = 4;
    const auto springs =
        ground_springs(prepared, energy, [&](const InterfaceNode&) { return ExpectedMotion(across, along); });
    const auto& nodes = prepared.interfaces.nodes();
    ASSERT_EQ(springs.size(), nodes.size());  // one label: all of them on the outside
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const Eigen::Vector3d normal = nodes[n].normal, tangent = normal.unitOrthogonal();
        const double share = energy * nodes[n].area / 100;  // what an area of 1 cm² says, mN mm
        EXPECT_EQ(springs[n].node, nodes[n].node);
        EXPECT_NEAR(force(springs[n], normal), share / (across * across), 1e-9 * share);
        EXPECT_NEAR(force(springs[n], tangent), share / (along * along), 1e-9 * share);
        EXPECT_EQ(springs[n].target, Eigen::Vector3d(0, 0, 0));
    }
}

TEST(Ground, HoldsAllWaysAlikeUnlessToldOtherwise) {
    const PreparedModel prepared = ellipsoid();
    const auto springs = ground_springs(prepared, 5, [](const InterfaceNode&) { return 2.0; });
    for (std::size_t n = 0; n < springs.size(); ++n)
        EXPECT_TRUE(springs[n].stiffness.isApprox(springs[n].stiffness(0, 0) * Eigen::Matrix3d::Identity(), 1e-9));
}

}  // namespace
}  // namespace tissuewarp::registration::detail
