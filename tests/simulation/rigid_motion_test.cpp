/// Bodies that turn and are displaced, against what that means point by point.

#include "simulation/rigid_motion.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <numbers>

namespace tissuewarp::simulation {
namespace {

using Eigen::Vector3d;

constexpr double pi = std::numbers::pi;

Vector3d place_of(const tled::RigidPlacement& placement, const Vector3d& X) {
    return placement.rotation * X + placement.shift;
}

TEST(RigidMotion, TurnsAboutThePointAtRestAndIsThenDisplaced) {
    // A quarter turn about z through (10, 0, 0), then 5 mm along x: the other order would turn the 5 mm too.
    const RigidMotion motion{{5, 0, 0}, {0, 0, pi / 2}, {10, 0, 0}};
    EXPECT_LT((place_of(placement_at(motion, 1), {12, 0, 3}) - Vector3d(15, 2, 3)).norm(), 1e-12);
    EXPECT_LT((place_of(placement_at(motion, 1), {10, 0, 7}) - Vector3d(15, 0, 7)).norm(), 1e-12) << "on the axis";
    const Vector3d half(10 + 2.5 + std::sqrt(2.0), std::sqrt(2.0), 3);
    EXPECT_LT((place_of(placement_at(motion, 0.5), {12, 0, 3}) - half).norm(), 1e-12);
    EXPECT_EQ(placement_at(motion, 0), tled::RigidPlacement{});
}

TEST(RigidMotion, MovesAPointToWhereItsBodyIs) {
    const RigidMotion motion{{5, 3, -1}, {0.4, -0.8, 2.0}, {10, 0, 40}};
    const Vector3d X(-70, 20, 30);
    EXPECT_LT((X + displacement_at(motion, 0.6, X) - place_of(placement_at(motion, 0.6), X)).norm(), 1e-12);
    EXPECT_EQ(displacement_at({{0.1, -0.7, 3}, {0, 0, 0}, {0, 0, 0}}, 0.3, X), 0.3 * Vector3d(0.1, -0.7, 3));
}

TEST(RigidMotion, WithoutATurnIsTheDisplacementBitByBit) {
    const RigidMotion motion{{0.1, -0.7, 3}, {0, 0, 0}, {500, 20, -30}};
    EXPECT_EQ(placement_at(motion, 0.3).shift, 0.3 * motion.displacement);
    EXPECT_EQ(placement_at(motion, 0.3).rotation, Eigen::Matrix3d::Identity());
    EXPECT_EQ(velocity_at(motion, 0.3, 2).of_origin, 2 * motion.displacement);
    EXPECT_FALSE(tled::turns({{{}, {}, 0, velocity_at(motion, 0.3, 2)}}));
}

TEST(RigidMotion, EndsWhereItBeganAfterAWholeTurn) {
    const RigidMotion motion{{0, 0, 0}, 2 * pi * Vector3d(1, 2, -2) / 3, {40, -30, 900}};
    const Vector3d X(-70, 20, 30);
    EXPECT_GT((place_of(placement_at(motion, 0.5), X) - X).norm(), 100);
    EXPECT_LT((place_of(placement_at(motion, 1), X) - X).norm(), 1e-11);
}

TEST(RigidMotion, VelocityIsTheSlopeOfTheWay) {
    const RigidMotion motion{{5, 3, -1}, {0.4, -0.8, 2.0}, {10, 0, 40}};
    constexpr double part = 0.37, rate = 1.7, h = 1e-6;
    const tled::RigidVelocity velocity = velocity_at(motion, part, rate);
    for (const Vector3d& X : {Vector3d(12, 0, 3), Vector3d(-70, 20, 30)}) {
        const Vector3d slope =
            (place_of(placement_at(motion, part + h), X) - place_of(placement_at(motion, part - h), X)) / (2 * h);
        const Vector3d here = place_of(placement_at(motion, part), X);
        EXPECT_LT((velocity.of_origin + velocity.spin.cross(here) - rate * slope).norm(), 1e-6);
        EXPECT_LE(slope.norm(), longest_way(motion, distance_from_axis(motion, X)) + 1e-9);
    }
}

}  // namespace
}  // namespace tissuewarp::simulation
