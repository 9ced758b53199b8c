/// Bodies as sampled distances against the distances themselves.

#include "simulation/obstacles.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "simulation/geometry.hpp"
#include "simulation/surface_distance.hpp"
#include "tled/nodal_effects.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::simulation {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

/// Nodes of a box of tissue, [0, 40]³ mm.
Matrix3Xd tissue() {
    return meshing::box_mesh({40, 40, 40}, {4, 4, 4}).nodes;
}

tled::Obstacle made(const Body& body, double gap = 0, const imaging::Volume* labels = nullptr) {
    Contact contact;
    contact.body = body;
    contact.gap = gap;
    return obstacle(contact, tissue(), 1.0, labels, silent_observer());
}

TEST(Obstacles, PlaneIsExactWhereverTissueMayGo) {
    const tled::Obstacle plane = made(HalfSpace{{0, 0, -2}, Vector3d(0, 1, 3).normalized()});
    for (const Vector3d& x : {Vector3d(5, 6, 7), Vector3d(-10, 45, 50), Vector3d(20, 20, -12)})
        EXPECT_NEAR(tled::distance_to(plane, x).value, (x - Vector3d(0, 0, -2)).dot(Vector3d(0, 1, 3).normalized()),
                    1e-4);
}

TEST(Obstacles, BallIsRoundAndSmallerByItsGap) {
    const Ball ball{{20, 20, 60}, 18};
    const tled::Obstacle round = made(ball, 0.5);
    for (const Vector3d& x : {Vector3d(20, 20, 41), Vector3d(30, 25, 45), Vector3d(20, 35, 50)})
        EXPECT_NEAR(tled::distance_to(round, x).value, (x - ball.centre).norm() - 17.5, 0.02);
}

TEST(Obstacles, OverlapIsRoomOrRefused) {
    EXPECT_NEAR(tled::distance_to(made(HalfSpace{{0, 0, 0.4}, Vector3d::UnitZ()}), Vector3d(1, 1, 0)).value, 0, 1e-5)
        << "the tissue's lowest nodes touch";
    EXPECT_THROW(made(HalfSpace{{0, 0, 3}, Vector3d::UnitZ()}), InvalidInput);
    EXPECT_NO_THROW(made(HalfSpace{{0, 0, 3}, Vector3d::UnitZ()}, 2.5));
}

// Tissue goes far in the frame of a body that turns; a grid for the body at rest would end before it.
TEST(Obstacles, BodiesThatTurnAreSampledWhereverTissueMayBe) {
    Contact contact;
    const HalfSpace plane{{0, 0, -2}, {0, 0, 1}};
    contact.body = plane;
    contact.motion = {{0, 3, 1}, {0, -2.0, 0}, {-50, 0, -2}};
    contact.curve = {{{0, 0}, {1, 1}, {2, -0.5}}};
    tled::Obstacle body = obstacle(contact, tissue(), 1.0, nullptr, silent_observer());
    for (const double part : {-0.5, 0.0, 0.4, 1.0}) {
        body.placement = placement_at(contact.motion, part);
        for (const Vector3d& x : {Vector3d(0, 0, 0), Vector3d(40, 0, 40), Vector3d(20, 40, 10)}) {
            const Vector3d point = body.placement.rotation * plane.point + body.placement.shift;
            EXPECT_NEAR(tled::distance_to(body, x).value, body.placement.rotation.col(2).dot(x - point), 1e-4);
        }
    }
}

TEST(Obstacles, OverlapIsLookedForWhereTheBodyIsAtTheBeginning) {
    Contact contact;
    contact.body = HalfSpace{{0, 0, -20}, {0, 0, 1}};
    contact.motion.displacement = {0, 0, 23};
    EXPECT_NO_THROW(obstacle(contact, tissue(), 1.0, nullptr, silent_observer()));
    contact.curve = {{{0, 1}, {1, 0}}};
    EXPECT_THROW(obstacle(contact, tissue(), 1.0, nullptr, silent_observer()), InvalidInput) << "3 mm inside";
    contact.motion = {{0, 0, 0}, {0, 0.2, 0}, {-100, 0, -20}};  // tan 0.2 of 100 to 140 mm lowers the plane
    EXPECT_NO_THROW(obstacle(contact, tissue(), 1.0, nullptr, silent_observer()));
    contact.motion.turn *= -1;
    EXPECT_THROW(obstacle(contact, tissue(), 1.0, nullptr, silent_observer()), InvalidInput) << "8.4 mm inside";
}

TEST(Obstacles, SurfaceReachesFromTheAxisAsFarAsTheBody) {
    const tled::Obstacle round = made(Ball{{20, 20, 60}, 18});
    const RigidMotion motion{{0, 0, 0}, {0, 0.3, 0}, {-40, 0, 60}};
    const double exact = 60 + 18, reach = surface_reach(*round.surface, motion);
    EXPECT_GE(reach, exact);
    EXPECT_LT(reach, exact + 10) << "within some samples";
    EXPECT_EQ(surface_reach(*round.surface, {}), 0);
}

TEST(Obstacles, LabelsAreBodiesAndHollows) {
    const imaging::Volume labels =
        painted({{1, Box{{0, 0, 0}, {40, 40, 40}}}, {5, Box{{-20, -20, -30}, {60, 60, -3}}}}, 1.0);
    // Surfaces lie half a voxel beyond the outermost centres; the hollow's corners are rounded, for which it is
    // widened.
    const tled::Obstacle table = made(ObstacleLabel{5}, 0, &labels);
    EXPECT_NEAR(tled::distance_to(table, Vector3d(20, 20, 10)).value, 12.5, 0.5);
    const tled::Obstacle hollow = made(OutsideOfLabels{{1, 5}}, 0, &labels);
    EXPECT_NEAR(tled::distance_to(hollow, Vector3d(20, 20, 35)).value, 5.5, 0.5);
    EXPECT_NEAR(tled::distance_to(hollow, Vector3d(20, 20, 45)).value, -4.5, 0.5) << "negative in the body around";
    EXPECT_THROW(made(ObstacleLabel{5}), InvalidInput) << "no volume";
}

// It ended 2.4 m below a body of labels once, which ends where its image does.
TEST(Obstacles, WhatPassedThroughABodyIsNoticed) {
    const imaging::Volume labels =
        painted({{1, Box{{0, 0, 0}, {40, 40, 40}}}, {5, Box{{-20, -20, -30}, {60, 60, -3}}}}, 1.0);
    Contact contact;
    contact.body = ObstacleLabel{5};
    const tled::Obstacle table = obstacle(contact, tissue(), 1.0, &labels, silent_observer());
    const auto lost = [&](const Vector3d& moved) {
        return passed_unseen(contact, table, tissue(), tissue().colwise() + moved, &labels);
    };
    EXPECT_EQ(lost({0, 0, -500}), tissue().cols());
    EXPECT_EQ(lost({0, 0, 500}), 0);
    EXPECT_EQ(lost({500, 0, 0}), 0);
}

meshing::SurfaceMesh box_surface() {
    meshing::TetMesh mesh = meshing::box_mesh({10, 20, 30}, {2, 2, 2});
    return meshing::boundary_surface(mesh).surface;
}

TEST(SurfaceDistance, IsThatOfTheBox) {
    const SurfaceDistance distance(box_surface());
    EXPECT_NEAR(distance({5, 10, 15}), -5, 1e-9);
    EXPECT_NEAR(distance({1, 10, 15}), -1, 1e-9);
    EXPECT_NEAR(distance({-3, 10, 15}), 3, 1e-9);
    EXPECT_NEAR(distance({13, 24, 15}), 5, 1e-9) << "from an edge";
    EXPECT_NEAR(distance({-1, -2, -2}), 3, 1e-9) << "from a corner";
}

TEST(SurfaceDistance, RefusesOpenAndInvertedSurfaces) {
    meshing::SurfaceMesh surface = box_surface();
    surface.triangles.row(0).swap(surface.triangles.row(1));
    EXPECT_THROW(SurfaceDistance{surface}, InvalidInput);
    surface = box_surface();
    surface.triangles.conservativeResize(3, surface.triangles.cols() - 1);
    EXPECT_THROW(SurfaceDistance{surface}, InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::simulation
