/// Contact that pushes and never pulls: its forces, their derivative, and tissue that only such contact brings to rest.
#include "tled/statics/one_sided_contact.hpp"
#include "tled/contact.hpp"
#include "tled/engine_choice.hpp"

#include "tests/tled/equilibrium_scenes.hpp"
#include "tled/model/springs.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

/// Everything below z = height.
Obstacle below_plane(double height) {
    DistanceGrid grid{{-400, -400, height - 200}, 80 * Eigen::Matrix3d::Identity(), {12, 12, 12}, {}};
    for (int k = 0; k < 12; ++k) grid.distance.insert(grid.distance.end(), 12 * 12, static_cast<float>(-200 + 80 * k));
    return {grid, {}, 0};
}

/// One node that does not touch and two that do.
class OneSidedContact : public testing::Test {
protected:
    const std::vector<Obstacle> plane{below_plane(1)};
    const std::vector<detail::ContactNode> nodes{{0, {0, 0, 0}, 5}, {1, {10, 0, 0}, 5}, {2, {20, 0, 4}, 5}};
    const std::vector<std::optional<detail::Touch>> touches{std::nullopt, detail::Touch{0, 2}, detail::Touch{0, 2}};
    const detail::OneSidedContact contact{plane, nodes, touches};
};

TEST_F(OneSidedContact, PushesAndNeverPulls) {
    // 1 mm deep; the same beyond a push of 2 mm; 3 mm away, which is more than the push.
    Matrix3Xd expected = Matrix3Xd::Zero(3, 3);
    expected.row(2) << 5, 15, 0;
    EXPECT_NEAR((contact.force(Matrix3Xd::Zero(3, 3)) - expected).norm(), 0, 1e-6);
}

TEST_F(OneSidedContact, StiffnessIsTheDerivativeOfItsForce) {
    const Matrix3Xd u = Matrix3Xd::Constant(3, 3, 0.1);
    const NodalConditions stiffened = contact.stiffened(nodal_conditions(Conditions{}, 3), u);
    ASSERT_THAT(stiffened.spring_node, testing::ElementsAre(0, 1));
    for (int c = 0; c < 3; ++c) {
        Matrix3Xd step = Matrix3Xd::Zero(3, 3), expected = step;
        step.row(c).setConstant(1e-3);
        for (int s = 0; s < 2; ++s) expected.col(s) = -detail::spring_matrix(stiffened, s) * step.col(s);
        EXPECT_NEAR((contact.force(u + step) - contact.force(u) - expected).norm(), 0, 1e-7) << c;
    }
}

// A block that is as soft as brain and 138 mm high loses a quarter of its height on a table. Nodes held to the table
// until the next round let it topple or fall through; the block's sides have to come to touch as it flattens.
TEST(EquilibriumInContact, LetsASoftBlockFlattenOnATable) {
    Model model;
    model.mesh = meshing::box_mesh({140.5, 114.4, 138.5}, {9, 8, 9});
    model.materials[1] = neo_hookean_stable(2.492, 0.4);
    const RestState rest = rest_state(model);
    Conditions conditions;
    conditions.external_force = Matrix3Xd::Zero(3, rest.node_count);
    conditions.external_force.row(2) = -9810 * rest.lumped_mass.transpose();
    RigidContact contact;
    contact.nodes = meshing::boundary_surface(model.mesh).node_of;
    const double spring = 0.1;  // softer ones would not keep it from leaning over
    for (const int node : contact.nodes)
        conditions.springs.push_back({node, spring * Eigen::Matrix3d::Identity(), Vector3d::Zero()});
    contact.obstacles.push_back(below_plane(-1.97));
    conditions.effects.contact = contact;
    const auto engine = make_cpu_engine(rest);
    ContactOptions options;
    options.equilibrium.rest = &rest;
    Listener listener;
    const ContactResult found =
        equilibrium_in_contact(*engine, rest, nodal_conditions(conditions, rest), options, nullptr, listener);
    EXPECT_THAT(listener.notes, testing::Contains(testing::HasSubstr("damped motion")));
    const Matrix3Xd& u = found.equilibrium.displacement;
    EXPECT_LE(found.largest_penetration_mm, options.penetration_mm);
    EXPECT_GE(found.reaction.row(2).minCoeff(), 0);
    double carried = found.reaction.row(2).sum();
    for (const int node : contact.nodes) carried -= spring * u(2, node);
    EXPECT_NEAR(carried / (9810 * rest.lumped_mass.sum()), 1, 1e-4);
    EXPECT_NEAR(u.colwise().norm().maxCoeff(), 31.6, 0.5);
    const Matrix3Xd place = rest.position + u;
    EXPECT_LT((place.rowwise().mean() - rest.position.rowwise().mean()).head<2>().norm(), 1);
}

}  // namespace
}  // namespace tissuewarp::tled
