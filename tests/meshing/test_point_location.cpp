#include "meshing/point_location.hpp"
#include "meshing/primitives.hpp"

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <limits>
#include <random>

namespace tissuewarp::meshing {
namespace {

/// Lowest index of a tetrahedron that holds the point, by solving for the barycentric coordinates in each.
int by_search(const TetMesh& mesh, const Eigen::Vector3d& point, double tolerance) {
    for (int t = 0; t < mesh.tet_count(); ++t) {
        Eigen::Matrix4d system;
        system.topRows<3>() = mesh.nodes(Eigen::all, mesh.tets.col(t));
        system.row(3).setOnes();
        const Eigen::Vector4d weights = system.inverse() * point.homogeneous();
        if (weights.minCoeff() >= -tolerance) return t;
    }
    return -1;
}

TEST(PointLocator, AgreesWithExhaustiveSearch) {
    const TetMesh mesh = box_mesh({3, 2, 1}, {5, 4, 3}, 0.15, 11);
    const PointLocator locator(mesh);
    std::mt19937 engine(5);
    std::uniform_real_distribution<double> x(-0.3, 3.3), y(-0.3, 2.3), z(-0.3, 1.3);
    int inside = 0;
    for (int trial = 0; trial < 2000; ++trial) {
        const Eigen::Vector3d point(x(engine), y(engine), z(engine));
        const auto location = locator.find(point);
        ASSERT_EQ(location ? location->tet : -1, by_search(mesh, point, 1e-9));
        inside += location.has_value();
    }
    EXPECT_GT(inside, 500);
}

TEST(PointLocator, WeightsReproduceThePoint) {
    const TetMesh mesh = box_mesh({3, 2, 1}, {5, 4, 3}, 0.15, 11);
    const PointLocator locator(mesh);
    const Eigen::Vector3d point(1.234, 0.777, 0.321);
    const auto location = locator.find(point);
    ASSERT_TRUE(location);
    EXPECT_NEAR(location->barycentric.sum(), 1.0, 1e-14);
    EXPECT_NEAR((interpolate(mesh, mesh.nodes, *location) - point).norm(), 0.0, 1e-13);
}

TEST(PointLocator, ReproducesALinearField) {
    const TetMesh mesh = box_mesh({1, 1, 1}, {4, 4, 4}, 0.15);
    const Eigen::RowVector3d gradient(2, -3, 0.5);
    const Eigen::MatrixXd field = gradient * mesh.nodes;
    const Eigen::Vector3d point(0.61, 0.13, 0.88);
    const auto location = PointLocator(mesh).find(point);
    ASSERT_TRUE(location);
    EXPECT_NEAR(interpolate(mesh, field, *location)[0], gradient.dot(point), 1e-13);
}

TEST(PointLocator, FindsTheLowestIndexOnSharedNodesAndTheOuterRim) {
    const TetMesh mesh = box_mesh({1, 1, 1}, {3, 3, 3});
    const PointLocator locator(mesh);
    for (int n = 0; n < mesh.node_count(); ++n) {
        const auto location = locator.find(mesh.nodes.col(n));
        ASSERT_TRUE(location) << "node " << n;
        EXPECT_EQ(location->tet, by_search(mesh, mesh.nodes.col(n), 1e-9));
    }
}

TEST(PointLocator, ToleranceReachesOutsideByBarycentricCoordinates) {
    const TetMesh mesh = box_mesh({1, 1, 1}, {2, 2, 2});
    const PointLocator locator(mesh);
    const Eigen::Vector3d outside(0.3, 0.2, 1.1);  // the cell's height is 0.5: coordinate −0.2 at most
    EXPECT_FALSE(locator.find(outside));
    EXPECT_FALSE(locator.find(outside, 0.15));
    const auto location = locator.find(outside, 0.25);
    ASSERT_TRUE(location);
    EXPECT_EQ(location->tet, by_search(mesh, outside, 0.25));
}

TEST(PointLocator, FindsNothingForPointsThatAreNotFinite) {
    const PointLocator locator(box_mesh({1, 1, 1}, {2, 2, 2}));
    constexpr double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    EXPECT_FALSE(locator.find({nan, 0.5, 0.5}));
    EXPECT_FALSE(locator.find({0.5, inf, 0.5}));
    EXPECT_FALSE(locator.find({1e300, 0.5, 0.5}));
}

}  // namespace
}  // namespace tissuewarp::meshing
