/// Scenes from their description to their frames, against closed forms.

#include "simulation/run.hpp"

#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "tests/simulation/cube.hpp"
#include "tests/support/noted.hpp"
#include "tled/model/internal_force.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>
#include <numbers>

namespace tissuewarp::simulation {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using test::cube;

struct Result {
    RunSummary summary;
    Matrix3Xd displacement;
    std::vector<double> times;
};

Result run(const BuiltScene& built) {
    Result result;
    result.summary = simulate(built, [&](const Frame& frame) {
        result.displacement = frame.displacement;
        result.times.push_back(frame.time);
    });
    return result;
}

/// A column without Poisson's ratio under its own weight is in uniaxial strain: P_zz = −ρ g (L − Z). For lnJ with
/// λ = 0, P = μ (F − 1/F), F from the quadratic, and u(L) = ∫ (F − 1) dZ.
double sag_of_top(double gravity) {
    constexpr double mu = 1.5, length = 100, density = 1e-6;
    constexpr int parts = 20000;
    double u = 0;
    for (int i = 0; i < parts; ++i) {
        const double z = length * (i + 0.5) / parts, p = -density * gravity * (length - z) / mu;
        u += (0.5 * (p + std::sqrt(p * p + 4)) - 1) * length / parts;
    }
    return u;
}

/// Mean z displacement of a set's faces: the cells' pattern favours some nodes, by tenths of a millimetre.
double mean_on(const BuiltScene& built, const std::string& set, const Matrix3Xd& displacement) {
    const tled::TissueMesh tissue = tled::closed(built.mesh);
    const Eigen::VectorXd area = nodal_areas(built.mesh, RegionFinder(tissue, built.scene.sets).faces(set));
    return displacement.row(2).dot(area) / area.sum();
}

/// Free to move along z only.
void keep_upright(Scene& scene) {
    scene.sets["everything"] = {};
    scene.fixed.push_back({"everything", {true, true, false}});
}

TEST(Simulate, CubeUnderItsWeightSagsAsTheClosedFormSays) {
    // A load of twice the size or of the other sign would be off by millimetres.
    Scene scene = cube(8);
    keep_upright(scene);
    scene.gravity = Gravity{std::nullopt, {0, 0, -1}, 9810.0, {}};
    const BuiltScene built = build(scene);
    const Result result = run(built);
    const double expected = sag_of_top(9810.0);
    EXPECT_LT(expected, -10);
    EXPECT_NEAR(mean_on(built, "above", result.displacement), expected, 0.05);
    EXPECT_LE(result.summary.estimated_error_mm, 1e-3);
}

TEST(Simulate, GravityOfTheImageIsNoLoad) {
    Scene scene = cube();
    test::stand_freely(scene);
    scene.gravity = Gravity{Vector3d(0, 0, -1), {0, 0, -1}, 9810.0, {}};
    EXPECT_LT(run(build(scene)).displacement.norm(), 1e-6);
}

TEST(Simulate, TurningGravityLoadsByTheDifference) {
    // From down to up: twice the weight upwards, which hangs the cube's top higher.
    Scene scene = cube(8);
    keep_upright(scene);
    scene.gravity = Gravity{Vector3d(0, 0, -1), {0, 0, 1}, 9810.0 / 4, {}};
    const BuiltScene built = build(scene);
    const Result result = run(built);
    const double expected = sag_of_top(-9810.0 / 2);
    EXPECT_GT(expected, 5);
    EXPECT_NEAR(mean_on(built, "above", result.displacement), expected, 0.05);
}

TEST(Simulate, GravityTurnsWithoutChangingItsSize) {
    const Gravity gravity{Vector3d(0, -1, 0), {0, 1, 0}, 9810.0, {}};
    for (const double time : {0.0, 0.3, 0.5, 1.0}) EXPECT_NEAR(gravity_at(gravity, time, 1).norm(), 9810.0, 1e-6);
    EXPECT_TRUE(gravity_at(gravity, 0, 1).isApprox(Vector3d(0, -9810, 0)));
    EXPECT_TRUE(gravity_at(gravity, 1, 1).isApprox(Vector3d(0, 9810, 0), 1e-9));
    EXPECT_NEAR(gravity_at(gravity, 0.5, 1).y(), 0, 1e-6);
    EXPECT_NEAR(gravity_at(gravity, 0.5, 1).z(), 0, 1e-6) << "about the z axis";
}

TEST(Simulate, PrescribedMotionFollowsItsCurve) {
    Scene scene = cube();
    scene.motions.push_back({"above", {false, false, true}, {{0, 0, -20}}, Curve{{{0, 0}, {0.5, 1}, {1, 0.5}}}});
    test::stand_freely(scene);
    scene.solve.frames = 4;
    const BuiltScene built = build(scene);
    std::vector<double> top;
    simulate(built, [&](const Frame& frame) {
        top.push_back(frame.displacement(2, built.mesh.node_count() - 1));
        if (frame.index < 4) return;
        for (int n = 0; n < built.mesh.node_count(); ++n) {  // even, without lateral strain: Poisson's ratio is 0
            const Vector3d expected(0, 0, -0.1 * built.mesh.nodes(2, n));
            EXPECT_LT((frame.displacement.col(n) - expected).norm(), 5e-3);
        }
    });
    ASSERT_EQ(top.size(), 5u);
    for (std::size_t f = 0; f < 5; ++f) EXPECT_NEAR(top[f], (std::array{0.0, -10.0, -20.0, -15.0, -10.0})[f], 1e-5);
}

TEST(Simulate, ElasticFoundationCarriesTheWeightByItsArea) {
    // ρ g L³ = 9810 mN on 10⁴ mm² of 0.2 kPa/mm: 4.905 mm.
    Scene scene = cube();
    scene.fixed.clear();
    scene.springs.push_back({"below", 0.2, 0.0, Springs::Along::AllDirections});
    scene.gravity = Gravity{std::nullopt, {0, 0, -1}, 9810.0, {}};
    const BuiltScene built = build(scene);
    const Result result = run(built);
    EXPECT_NEAR(mean_on(built, "below", result.displacement), -4.905, 2e-3)
        << "springs of stiffness times area carry all of the weight";
}

TEST(Simulate, LigamentsShareTheirStiffnessEvenly) {
    Scene scene = cube();
    scene.fixed.clear();
    scene.springs.push_back({"below", 0.0, 2000.0, Springs::Along::AllDirections});
    const BuiltScene built = build(scene);
    double total = 0;
    for (const tled::Spring& spring : built.springs) total += spring.stiffness(2, 2);
    EXPECT_NEAR(total, 2000.0, 1e-9) << "N/m is mN/mm";
    scene.springs[0] = {"below", 0.1, 0.0, Springs::Along::Normal};
    for (const tled::Spring& spring : build(scene).springs) {
        EXPECT_GT(spring.stiffness(2, 2), 0);
        EXPECT_EQ(spring.stiffness.trace(), spring.stiffness(2, 2)) << "none along the side";
    }
}

TEST(Simulate, DynamicsComesToRestWhereEquilibriumIs) {
    Scene scene = cube();
    test::stand_freely(scene);
    scene.gravity = Gravity{std::nullopt, {0, 0, -1}, 9810.0, {}};
    const Result still = run(build(scene));
    scene.solve.kind = Solve::Kind::Dynamics;
    scene.solve.duration = 6.0;
    scene.solve.frames = 12;
    scene.solve.damping = 15.0;
    const Curve half_a_second{{{0, 0}, {0.5, 1}}};
    scene.gravity->curve = half_a_second;
    const Result moved = run(build(scene));
    ASSERT_EQ(moved.times.size(), 13u);
    for (int f = 0; f <= 12; ++f) EXPECT_NEAR(moved.times[static_cast<std::size_t>(f)], 0.5 * f, 1e-12);
    EXPECT_LT((moved.displacement - still.displacement).colwise().norm().maxCoeff(), 0.02);
}

TEST(Simulate, SlowMotionInDynamicsEndsAtItsTarget) {
    Scene scene = cube();
    test::stand_freely(scene);
    scene.motions.push_back({"above", {false, false, true}, {{0, 0, -20}}, Curve{{{0, 0}, {1, 1}}}});
    scene.solve.kind = Solve::Kind::Dynamics;
    scene.solve.duration = 2.0;
    scene.solve.damping = 20.0;
    const BuiltScene built = build(scene);
    const Result result = run(built);
    for (int n = 0; n < built.mesh.node_count(); ++n)
        EXPECT_LT((result.displacement.col(n) - Vector3d(0, 0, -0.2 * built.mesh.nodes(2, n))).norm(), 0.05);
}

// A hundredth of an edge is 0.25 mm here, less than that was once no motion at all.
TEST(Simulate, DynamicsMovesByNextToNothingToo) {
    Scene scene = cube();
    test::stand_freely(scene);
    scene.motions.push_back({"above", {false, false, true}, {{0, 0, -0.1}}, Curve{{{0, 0}, {1, 1}}}});
    scene.solve.kind = Solve::Kind::Dynamics;
    scene.solve.duration = 2.0;
    scene.solve.damping = 20.0;
    const BuiltScene built = build(scene);
    EXPECT_NEAR(mean_on(built, "above", run(built).displacement), -0.1, 1e-3);
}

TEST(Simulate, ResectionLeavesTheRestWhereItWas) {
    Scene scene = cube();
    test::stand_freely(scene);
    scene.sets["upper half"].half_space = HalfSpace{{0, 0, 50}, {0, 0, -1}};
    scene.gravity = Gravity{std::nullopt, {0, 0, -1}, 9810.0, Curve{{{0, 1}}}};
    scene.resections.push_back({"upper half", 0.5});
    scene.probes = {{"low", {50, 50, 25}}, {"high", {50, 50, 75}}};
    scene.solve.frames = 2;
    for (const auto kind : {Solve::Kind::Equilibrium, Solve::Kind::Dynamics}) {
        scene.solve.kind = kind;
        scene.solve.damping = 15;
        scene.solve.duration = 4.0;
        scene.resections[0].time = 2.0;
        scene.gravity->curve = Curve{{{0, 0}, {0.5, 1}}};
        scene.solve.frames = 4;
        const BuiltScene built = build(scene);
        ASSERT_EQ(built.stages.size(), 2u);
        EXPECT_EQ(built.stages[1].tet.size() * 2, built.stages[0].tet.size());
        std::vector<Matrix3Xd> probes;
        std::vector<int> stages;
        simulate(built, [&](const Frame& frame) {
            probes.push_back(probe_displacements(built, frame));
            stages.push_back(frame.stage);
        });
        EXPECT_EQ(stages, (std::vector{0, 0, 1, 1, 1}));
        EXPECT_TRUE(probes[1].allFinite());
        EXPECT_TRUE(std::isnan(probes[4](2, 1))) << "its tissue is gone";
        EXPECT_LT(probes[1](2, 0), -2) << "sagged under all of the cube";
        EXPECT_GT(probes[4](2, 0), 0.55 * probes[1](2, 0)) << "and came back when the upper half was taken off";
        EXPECT_LT(probes[4](2, 0), -0.5);
    }
}

TEST(Simulate, FreeTissueGrowsByItsStretch) {
    Scene scene = cube();
    scene.tissues[1].material = tled::neo_hookean_iso(3.0, 0.4);
    scene.tissues[1].growth = 1.1;
    test::stand_freely(scene);
    const BuiltScene built = build(scene);
    const Result result = run(built);
    EXPECT_LT((result.displacement - 0.1 * built.mesh.nodes).colwise().norm().maxCoeff(), 5e-3);
}

TEST(Simulate, TractionPullsAsAPressureDoesWhereTheSurfaceStaysAsItIs) {
    Scene pressed = cube(), pulled = cube();
    keep_upright(pressed);
    keep_upright(pulled);
    pressed.pressures.push_back({"above", -0.5, {}});
    pulled.tractions.push_back({"above", {0, 0, 0.5}, {}});
    const BuiltScene built = build(pulled);
    const Result result = run(built);
    EXPECT_GT(mean_on(built, "above", result.displacement), 10);
    EXPECT_LT((result.displacement - run(build(pressed)).displacement).colwise().norm().maxCoeff(), 5e-3);
}

TEST(Simulate, WhatIsTurnedByHalfATurnGoesThereAlongACircle) {
    Scene scene = cube();
    scene.fixed[0].axes = {true, true, true};
    scene.motions.push_back({"above", {true, true, true}, {{0, 0, 0}, {0, 0, std::numbers::pi}, {50, 50, 100}}, {}});
    const BuiltScene built = build(scene);
    const Result result = run(built);
    EXPECT_GT(result.summary.min_jacobian, 0.2) << "a straight way would lead through the axis";
    for (int n = 0; n < built.mesh.node_count(); ++n) {
        const Vector3d X = built.mesh.nodes.col(n), x = X + result.displacement.col(n);
        if (X.z() != 50 || (X - Vector3d(50, 50, 50)).norm() < 1) continue;
        const Vector3d arm = X - Vector3d(50, 50, 50), turned(-arm.y(), arm.x(), 0);
        EXPECT_GT((x - Vector3d(50, 50, 50)).normalized().dot(turned.normalized()), 0.95) << "a quarter turn midway";
    }
}

TEST(Simulate, BodyInContactStopsTheTissue) {
    // The top is pushed down by 20 mm, the base meets a table after 5 mm: what is between is pressed evenly.
    Scene scene = cube();
    scene.fixed.clear();
    keep_upright(scene);
    scene.motions.push_back({"above", {false, false, true}, {{0, 0, -20}}, {}});
    Contact table;
    table.body = HalfSpace{{0, 0, -5}, {0, 0, 1}};
    scene.contacts.push_back(table);
    scene.solve.frames = 2;
    const BuiltScene built = build(scene);
    const Result result = run(built);
    for (int n = 0; n < built.mesh.node_count(); ++n) {
        const double expected = -5 - 15 * built.mesh.nodes(2, n) / 100;
        EXPECT_NEAR(result.displacement(2, n), expected, 0.05);
    }
}

TEST(Simulate, TissueThatOnlySoftSpringsHoldRestsOnAPlane) {
    // The springs alone would let it sink by ten metres: it found no way back from there.
    Scene scene = cube(8);
    scene.fixed.clear();
    keep_upright(scene);
    scene.springs.push_back({"everything", 0.0, 1.0, Springs::Along::AllDirections});
    scene.gravity = Gravity{std::nullopt, {0, 0, -1}, 9810.0, {}};
    Contact table;
    table.body = HalfSpace{{0, 0, -3}, {0, 0, 1}};
    scene.contacts.push_back(table);
    const BuiltScene built = build(scene);
    const Result result = run(built);
    EXPECT_NEAR(mean_on(built, "below", result.displacement), -3, 0.01);
    EXPECT_NEAR(mean_on(built, "above", result.displacement), -3 + sag_of_top(9810.0), 0.07);
}

TEST(Simulate, LayersSlideOnOneAnother) {
    // Joined, the upper layer would drag the lower one along; apart, each keeps its shape.
    Scene scene = cube();
    BoxGeometry box = std::get<BoxGeometry>(scene.geometry);
    meshing::TetMesh mesh = meshing::box_mesh(box.size, box.cells);
    for (int e = 0; e < mesh.tet_count(); ++e)
        if (mesh.nodes(2, mesh.tets.col(e)).mean() > 50) mesh.labels[e] = 2;
    scene.geometry = mesh;
    scene.tissues[2] = scene.tissues[1];
    scene.fixed[0].axes = {true, true, true};
    scene.motions.push_back({"above", {true, true, true}, {{8, 0, 0}}, {}});
    const auto largest_strain = [](const Scene& each) {
        const BuiltScene built = build(each);
        const Result result = run(built);
        double shear = 0;  // difference of x along the edges of each layer
        for (int e = 0; e < built.mesh.tet_count(); ++e)
            shear = std::max(shear, result.displacement(0, built.mesh.tets.col(e)).maxCoeff() -
                                        result.displacement(0, built.mesh.tets.col(e)).minCoeff());
        return shear;
    };
    EXPECT_GT(largest_strain(scene), 1.9) << "joined: 8 mm over four cells";
    scene.sliding.push_back({{1, 2}, 10.0, ""});
    EXPECT_LT(largest_strain(scene), 0.02);
}

TEST(Simulate, ProbesLieInTheTissue) {
    Scene scene = cube();
    scene.probes = {{"middle", {50, 50, 50}}};
    EXPECT_NO_THROW(build(scene));
    scene.probes[0].at.x() = 130;
    EXPECT_THROW(build(scene), InvalidInput);
}

TEST(Simulate, RefusesContradictions) {
    Scene scene = cube();
    scene.motions.push_back({"below", {false, false, true}, {{0, 0, 1}}, {}});
    EXPECT_THROW(build(scene), InvalidInput) << "held and moved";
    scene.motions[0].axes = {true, true, false};
    EXPECT_NO_THROW(build(scene));
    scene = cube();
    scene.tissues[2] = scene.tissues[1];
    EXPECT_THROW(build(scene), InvalidInput) << "a tissue without a tetrahedron";
    scene = cube();
    scene.fixed.clear();
    EXPECT_THROW(simulate(build(scene)), InvalidInput) << "nothing holds it";
}

TEST(Simulate, RefusesFrictionInEquilibrium) {
    Scene scene = cube();
    Contact table;
    table.body = HalfSpace{{0, 0, -5}, {0, 0, 1}};
    table.friction = 0.3;
    scene.contacts.push_back(table);
    EXPECT_THROW(simulate(build(scene)), InvalidInput);
}

TEST(Simulate, AColumnThatBucklesUnderItsWeightIsFollowedToWhereItHangs) {
    // Held at its foot it stands up to (7.84 E I/(ρ g A))^⅓ = 51 mm (Greenhill 1881), and is 90 mm high.
    Scene scene;
    scene.geometry = BoxGeometry{Eigen::Vector3d::Zero(), {20, 24, 90}, {3, 4, 12}};
    scene.tissues[1].material = tled::neo_hookean_lnj(5.0, 0.3);
    scene.sets["foot"].side = Side{2, false, 0.0};
    scene.fixed.push_back({"foot", {true, true, true}});
    scene.gravity = Gravity{std::nullopt, {0, 0, -1}, 9810.0, {}};
    scene.solve.device = Device::Cpu;
    const BuiltScene built = build(scene);
    tissuewarp::test::Noted observer;
    Matrix3Xd u;
    const RunSummary summary = simulate(
        built, [&](const Frame& frame) { u = frame.displacement; }, observer);
    EXPECT_LE(summary.estimated_error_mm, scene.solve.tolerance_mm);
    EXPECT_LT(u.row(2).minCoeff(), -100) << "its head hangs below its foot";
    EXPECT_NE(observer.notes.find("several equilibria"), std::string::npos) << observer.notes;
}

struct Cancelling : Observer {
    int looks = 0;
    bool cancel_requested() override { return ++looks > 2; }
};

TEST(Simulate, StopsWhenAsked) {
    Scene scene = cube();
    test::stand_freely(scene);
    scene.gravity = Gravity{std::nullopt, {0, 0, -1}, 9810.0, {}};
    scene.solve.frames = 20;
    Cancelling observer;
    const BuiltScene built = build(scene);
    observer.looks = 0;
    EXPECT_THROW(simulate(
                     built, [](const Frame&) {}, observer),
                 Cancelled);
}

// An organ on another one, pushed down on one side and lifted on the other: rounds of pairs that are held or absent end
// in the equilibrium of forces to one side. Pairs that were decided wrongly leave the force that they bear.
TEST(Simulate, SurfacesThatMayPartComeToTheEquilibriumOfTheirOneSidedForces) {
    Scene scene;
    scene.title = "organs";
    scene.geometry =
        ShapeGeometry{{{2, Box{{-30, -25, 0}, {30, 25, 25}}}, {1, Ellipsoid{{0, 0, -2}, {28, 22, 18}}}}, 7.0};
    for (const int label : {1, 2}) scene.tissues[label].material = tled::neo_hookean_lnj(3.0, 0.4);
    scene.sets["bottom"].side = Side{2, false, 8.0};
    scene.sets["left"].side = Side{0, false, 3.0};
    scene.sets["lifted"].box = Box{{10, -25, 20}, {30, 25, 26}};
    scene.fixed.push_back({"bottom", {true, true, true}});
    scene.fixed.push_back({"left", {true, true, true}});
    scene.motions.push_back({"lifted", {false, false, true}, {{0, 0, 8}}, {}});
    scene.sets["pushed"].box = Box{{-24, -25, 20}, {-5, 25, 26}};
    scene.motions.push_back({"pushed", {false, false, true}, {{0, 0, -3}}, {}});
    scene.sliding.push_back({{1, 2}, 100.0, "", Sliding::Opening::Free});
    scene.solve.device = Device::Cpu;
    scene.solve.tolerance_mm = 1e-3;
    const BuiltScene built = build(scene);
    const Matrix3Xd u = run(built).displacement;
    const Stage& stage = built.stages.front();
    const tled::NodalConditions conditions =
        tled::nodal_conditions(conditions_at(built, stage, scene.solve.duration), stage.rest);
    ASSERT_FALSE(conditions.effects.surface.parting.empty());
    const Matrix3Xd force =
        tled::internal_force(stage.rest, u) - tled::surface_force(conditions.effects.surface, stage.rest.position, u);
    const Matrix3Xd zero = Matrix3Xd::Zero(3, u.cols());
    EXPECT_LT(conditions.constrained.select(zero, force).cwiseAbs().maxCoeff(), 2e-3 * force.cwiseAbs().maxCoeff());
    int pressing = 0, apart = 0;
    for (const tled::SlidingPair& pair : conditions.effects.surface.parting) {
        const double g = tled::overlap(pair, u);
        pressing += g > 0;
        apart += g < -1;
    }
    EXPECT_GT(pressing, 10);
    EXPECT_GT(apart, 20);
}

/// A cube with a ball just above it, which is to be turned or displaced into it.
Scene under_a_ball() {
    Scene scene = cube(6, 0.3);
    test::stand_freely(scene);
    Contact ball;
    ball.body = Ball{{50, 50, 140}, 39};
    scene.contacts.push_back(ball);
    scene.solve.frames = 2;
    return scene;
}

// A ball that turns about an axis is a ball that is displaced along the arc: what differs is the path of the code, and
// the samples, which turn with it.
TEST(Simulate, BallThatTurnsPressesAsOneThatIsDisplacedToTheSamePlace) {
    Scene turned = under_a_ball(), displaced = turned;
    RigidMotion& turn = turned.contacts.back().motion;
    turn = {{0, 0, 0}, {0, 0.4, 0}, {20, 50, 140}};
    const tled::RigidPlacement end = placement_at(turn, 1);
    const Vector3d centre(50, 50, 140), way = end.rotation * centre + end.shift - centre;
    ASSERT_LT(way.z(), -11);
    displaced.contacts.back().motion.displacement = way;
    const Result by_turn = run(build(turned)), by_way = run(build(displaced));
    EXPECT_GT(by_way.displacement.colwise().norm().maxCoeff(), 8);
    EXPECT_LT((by_turn.displacement - by_way.displacement).colwise().norm().maxCoeff(), 0.05);
}

TEST(Simulate, BodyThatTurnsAllTheWayRoundLeavesTheTissueAsItWas) {
    Scene scene = under_a_ball();
    scene.contacts.back().body = Ball{{50, 50, 190}, 38};  // 8 mm deep half way
    scene.contacts.back().motion = {{0, 0, 0}, {0, 2 * std::numbers::pi, 0}, {50, 50, 160}};
    scene.solve.frames = 4;
    const BuiltScene built = build(scene);
    std::vector<double> largest;
    simulate(built, [&](const Frame& frame) { largest.push_back(frame.displacement.colwise().norm().maxCoeff()); });
    ASSERT_EQ(largest.size(), 5u);
    EXPECT_GT(largest[2], 5);
    EXPECT_LT(largest[4], 2e-3);
}

}  // namespace
}  // namespace tissuewarp::simulation
