/// Data inside elements against the same energy minimised as a dense system.
#include "registration/springs/pull.hpp"

#include <gtest/gtest.h>
#include <Eigen/Dense>

namespace tissuewarp::registration::detail {
namespace {

meshing::TetMesh two_tets() {
    meshing::TetMesh mesh;
    mesh.nodes.resize(3, 5);
    mesh.nodes << 0, 10, 0, 0, 10, 0, 0, 10, 0, 10, 0, 0, 0, 10, 10;
    mesh.tets.resize(4, 2);
    mesh.tets << 0, 1, 1, 4, 2, 2, 3, 3;
    mesh.labels = Eigen::VectorXi::Ones(2);
    return mesh;
}

/// Three pulls, one of them blind along two axes.
std::vector<Pull> some_pulls() {
    Eigen::Matrix3d edge = Eigen::Matrix3d::Zero();
    edge(0, 0) = 7;
    return {{{0, {0.1, 0.2, 0.3, 0.4}}, {1, -2, 0.5}, 5 * Eigen::Matrix3d::Identity()},
            {{1, {0.6, 0.1, 0.2, 0.1}}, {-1, 0, 2}, Eigen::Vector3d(1, 2, 3).asDiagonal()},
            {{1, {0.25, 0.25, 0.25, 0.25}}, {0.3, 9, 9}, edge}};
}

/// Nodal forces of the pulls at u: Σ w_a K (target − u(X)).
Eigen::Matrix3Xd forces(const meshing::TetMesh& mesh, const std::vector<Pull>& pulls, const Eigen::Matrix3Xd& u) {
    Eigen::Matrix3Xd result = Eigen::Matrix3Xd::Zero(3, mesh.node_count());
    for (const Pull& pull : pulls)
        for (int a = 0; a < 4; ++a)
            result.col(mesh.tets(a, pull.at.tet)) +=
                pull.at.barycentric[a] * pull.stiffness * (pull.target - displacement_at(mesh, u, pull.at));
    return result;
}

double energy(const meshing::TetMesh& mesh, const std::vector<Pull>& pulls, const Eigen::Matrix3Xd& u) {
    double sum = 0;
    for (const Pull& pull : pulls) {
        const Eigen::Vector3d e = displacement_at(mesh, u, pull.at) - pull.target;
        sum += 0.5 * e.dot(pull.stiffness * e);
    }
    return sum;
}

Eigen::Matrix3Xd some_displacement() {
    Eigen::Matrix3Xd u(3, 5);
    u << 1, 0, -1, 2, 0.5, 0, 3, 1, -2, 1, 0.25, 0, 1, 1, -1;
    return u;
}

// A target solved with the wrong stiffness, or forces lost where it is singular, shows here.
TEST(Pull, LumpedSpringsHaveThePullsForces) {
    const auto mesh = two_tets();
    const Eigen::Matrix3Xd u = some_displacement();
    Eigen::Matrix3Xd lumped = Eigen::Matrix3Xd::Zero(3, 5);
    for (const tled::Spring& spring : lumped_springs(mesh, some_pulls(), u))
        lumped.col(spring.node) += spring.stiffness * (spring.target - u.col(spring.node));
    EXPECT_LT((lumped - forces(mesh, some_pulls(), u)).norm(), 1e-9);
}

// Springs of too little stiffness overshoot: the energy would rise.
TEST(Pull, MovingToTheLumpedTargetsLowersTheEnergyToItsMinimum) {
    const auto mesh = two_tets();
    const auto pulls = some_pulls();
    Eigen::Matrix3Xd u = some_displacement();
    double before = energy(mesh, pulls, u);
    for (int round = 0; round < 300; ++round) {
        Eigen::Matrix3Xd next = u;
        for (const tled::Spring& spring : lumped_springs(mesh, pulls, u)) next.col(spring.node) = spring.target;
        const double after = energy(mesh, pulls, next);
        ASSERT_LE(after, before * (1 + 1e-12) + 1e-12) << "round " << round;
        before = after;
        u = next;
    }
    EXPECT_LT(before, 1e-9);  // three pulls on five nodes can all be satisfied
}

TEST(Pull, ANodeWithoutPullsGetsNoSpring) {
    const auto mesh = two_tets();
    const std::vector<Pull> one{some_pulls()[0]};
    for (const tled::Spring& spring : lumped_springs(mesh, one, some_displacement())) EXPECT_NE(spring.node, 4);
}

TEST(Pull, PointsJustOutsideAreDrawnToTheMeshAndFarOnesAreNotFound) {
    const auto mesh = two_tets();
    const meshing::PointLocator locator(mesh);
    const auto inside = locate_near(locator, {1, 2, 3});
    ASSERT_TRUE(inside);
    EXPECT_LT(
        (mesh.nodes(Eigen::all, mesh.tets.col(inside->tet)) * inside->barycentric - Eigen::Vector3d(1, 2, 3)).norm(),
        1e-9);
    const auto near = locate_near(locator, {-1, 3, 3});
    ASSERT_TRUE(near);
    EXPECT_GE(near->barycentric.minCoeff(), 0);
    EXPECT_NEAR(near->barycentric.sum(), 1, 1e-12);
    EXPECT_FALSE(locate_near(locator, {-20, 3, 3}));
}

}  // namespace
}  // namespace tissuewarp::registration::detail
