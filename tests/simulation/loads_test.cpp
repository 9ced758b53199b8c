/// Conditions brought to a time in place are those that are made anew.

#include "simulation/loads.hpp"

#include "tests/simulation/cube.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::simulation {
namespace {

using Eigen::Vector3d;

Scene with_everything() {
    Scene scene = test::cube();
    scene.sets["tool"].box = Box{{30, 30, 99}, {70, 70, 101}};
    scene.sets["front"].side = Side{1, false, 0.0};
    scene.sets["corner"].ball = Ball{{100, 100, 100}, 60};
    scene.motions.push_back(
        {"tool", {true, false, true}, {{2, 0, -5}, {0, 0.2, 0.1}, {50, 50, 90}}, Curve{{{0.1, 0}, {0.7, 1}}}});
    scene.springs.push_back({"front", 0.3, 0.0, Springs::Along::Normal});
    scene.gravity = Gravity{Vector3d(0, 0, -1), Vector3d(0, -1, -1).normalized(), 9810.0, {}};
    scene.fluid = FluidLevel{1.1e-6, 90, 30, Curve{{{0, 0}, {0.5, 1}}}};
    scene.pressures.push_back({"front", 0.4, {}});
    scene.pressures.push_back({"above", -0.2, Curve{{{0, 1}, {1, 0}}}});
    scene.tractions.push_back({"above", {0.1, 0, 0.2}, Curve{{{0.05, 0}, {0.6, 1}}}});
    scene.tractions.push_back({"front", {0, 0.3, 0}, {}});
    scene.membranes.push_back({"front", 20.0, 0.5});
    Contact table;
    table.body = HalfSpace{{0, 0, -1}, {0, 0, 1}};
    table.motion = {{0, 0, 3}, {0.1, -0.2, 0.05}, {50, 40, 0}};
    scene.contacts.push_back(table);
    scene.resections.push_back({"corner", 0.5});
    return scene;
}

void expect_equal(const tled::NodalConditions& a, const tled::NodalConditions& b) {
    EXPECT_EQ(a.constrained, b.constrained);
    EXPECT_EQ(a.imposed, b.imposed);
    EXPECT_EQ(a.external_force, b.external_force);
    EXPECT_EQ(a.spring_node, b.spring_node);
    EXPECT_EQ(a.spring_stiffness, b.spring_stiffness);
    EXPECT_EQ(a.effects.surface.pressure_faces, b.effects.surface.pressure_faces);
    EXPECT_EQ(a.effects.surface.pressure, b.effects.surface.pressure);
    EXPECT_EQ(a.effects.surface.membrane_faces, b.effects.surface.membrane_faces);
    EXPECT_EQ(a.effects.fluid->level, b.effects.fluid->level);
    EXPECT_EQ(a.effects.fluid->up, b.effects.fluid->up);
    EXPECT_EQ(a.effects.fluid->rest_height, b.effects.fluid->rest_height);
    EXPECT_EQ(a.effects.fluid->weight, b.effects.fluid->weight);
    EXPECT_EQ(a.effects.contact->node, b.effects.contact->node);
    EXPECT_EQ(a.effects.contact->obstacles[0].placement, b.effects.contact->obstacles[0].placement);
    EXPECT_EQ(a.effects.contact->obstacles[0].velocity, b.effects.contact->obstacles[0].velocity);
}

TEST(LoadsInTime, AreTheConditionsOfThatTime) {
    Scene stands = with_everything();  // gravity, for a while
    stands.gravity->curve = Curve{{{0.25, 0}, {0.3, 1}, {0.8, 1}, {1, 0}}};
    for (const Scene& scene : {with_everything(), stands}) {
        const BuiltScene built = build(scene);
        ASSERT_EQ(built.stages.size(), 2u);
        for (const Stage& stage : built.stages) {
            LoadsInTime loads(built, stage, 0.0);
            for (const double time : {0.0, 0.1, 0.3, 0.65, 0.7, 1.0, 0.2})
                expect_equal(loads.at(time), tled::nodal_conditions(conditions_at(built, stage, time), stage.rest));
        }
    }
}

TEST(LoadsInTime, AreThoseOfTheImageAtTheBeginning) {
    Scene scene = with_everything();
    scene.pressures.clear();
    scene.tractions.clear();
    const BuiltScene built = build(scene);
    const Stage& stage = built.stages.front();
    const tled::NodalConditions rest = LoadsInTime(built, stage, 0.0).at(0.0);
    const Eigen::Matrix3Xd zero = Eigen::Matrix3Xd::Zero(3, stage.rest.node_count);
    const Eigen::Matrix3Xd force = rest.external_force + tled::fluid_force(*rest.effects.fluid, zero);
    EXPECT_LT(force.cwiseAbs().maxCoeff(), 1e-9) << "weight and lift that the image shows are in balance there";
    EXPECT_TRUE(rest.imposed.isZero());
    const tled::NodalConditions later = LoadsInTime(built, stage, 1.0).at(1.0);
    const Eigen::Vector3d sum =
        later.external_force.rowwise().sum() + tled::fluid_force(*later.effects.fluid, zero).rowwise().sum();
    EXPECT_GT(sum.norm(), 1000) << "mN, when the level has fallen and gravity turned";
}

TEST(LoadsInTime, AreHeldForLessThanAHundredthOfALoadOrOfAnEdge) {
    Scene scene = test::cube();
    scene.motions.push_back({"above", {false, false, true}, {{0, 0, -20}}, {}});
    const BuiltScene built = build(scene);
    EXPECT_NEAR(hold_interval(built, built.stages[0]), 0.01 * 25 / 20, 1e-12) << "cells of 25 mm, 20 mm/s";
    scene.motions.clear();
    EXPECT_EQ(hold_interval(build(scene), built.stages[0]), scene.solve.duration) << "nothing changes";
    scene.gravity = Gravity{std::nullopt, {0, 0, -1}, 9810.0, Curve{{{0, 0}, {0.1, 1}}}};
    EXPECT_NEAR(hold_interval(build(scene), built.stages[0]), 1e-3, 1e-12);
    scene.gravity.reset();
    scene.tractions.push_back({"above", {0.1, 0, 0}, Curve{{{0, 0}, {0.2, 1}}}});
    EXPECT_NEAR(hold_interval(build(scene), built.stages[0]), 2e-3, 1e-12);
    scene.tractions.clear();
    scene.motions.push_back({"above", {true, true, true}, {{0, 0, 0}, {0, 0, 0.5}, {0, 0, 0}}, {}});
    EXPECT_NEAR(hold_interval(build(scene), built.stages[0]), 0.01 * 25 / (0.5 * std::hypot(100, 100)), 1e-12)
        << "the corner across from the axis";
}

// The furthest point of a body that turns about a point far off goes far.
TEST(LoadsInTime, AreHeldWhileNoPointOfABodyGoesFurtherThanAHundredthOfAnEdge) {
    Scene scene = test::cube();
    Contact ball;
    ball.body = Ball{{50, 50, 120}, 15};
    ball.motion = {{0, 3, 0}, {0, 0.5, 0}, {-150, 50, 120}};
    scene.contacts.push_back(ball);
    const BuiltScene built = build(scene);
    const double exact = 0.01 * 25 / (3 + 0.5 * 215);
    EXPECT_LE(hold_interval(built, built.stages[0]), exact);
    EXPECT_GT(hold_interval(built, built.stages[0]), 0.95 * exact);
}

}  // namespace
}  // namespace tissuewarp::simulation
