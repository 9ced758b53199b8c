/// The plain float64 forces of effects against their energies and closed forms, and what is refused.
#include "meshing/primitives.hpp"
#include "tests/tled/engine_scene.hpp"
#include "tled/conditions.hpp"

#include "core/errors.hpp"

#include <gmock/gmock.h>
#include <Eigen/Geometry>

#include <cmath>
#include <functional>
#include <limits>
#include <string>

namespace tissuewarp::tled {
namespace {

using namespace scene;
using Eigen::Matrix3Xi;
using ::testing::HasSubstr;

Matrix3Xi boundary_faces(const meshing::TetMesh& mesh) {
    const meshing::BoundarySurface boundary = meshing::boundary_surface(mesh);
    Matrix3Xi faces = boundary.surface.triangles;
    for (int& node : faces.reshaped()) node = boundary.node_of[static_cast<std::size_t>(node)];
    return faces;
}

/// A jittered cube of 30 mm that is bent.
struct Organ {
    Model model = cube(4, Element::T4, Laws::Iso);
    RestState rest = rest_state(model);
    Matrix3Xi faces = boundary_faces(model.mesh);
    Matrix3Xd u = wavy(model.mesh.nodes);
};

/// −dE/du by central differences at a few nodes.
Matrix3Xd slope(const NodalEffects& effects, const Matrix3Xd& X, const Matrix3Xd& u, const std::vector<int>& nodes) {
    constexpr double h = 1e-4;
    Matrix3Xd force(3, static_cast<Eigen::Index>(nodes.size()));
    for (std::size_t i = 0; i < nodes.size(); ++i)
        for (int c = 0; c < 3; ++c) {
            Matrix3Xd there = u, here = u;
            there(c, nodes[i]) += h;
            here(c, nodes[i]) -= h;
            force(c, static_cast<Eigen::Index>(i)) = -(energy(effects, X, there) - energy(effects, X, here)) / (2 * h);
        }
    return force;
}

const std::vector<int> some_nodes{0, 3, 17, 40, 62, 99, 124};

void expect_gradient(const Effects& effects) {
    const Organ organ;
    const NodalEffects nodal = nodal_effects(effects, organ.rest);
    Matrix3Xd force = surface_force(nodal.surface, organ.rest.position, organ.u);
    if (nodal.fluid) force += fluid_force(*nodal.fluid, organ.u);
    const Matrix3Xd expected = slope(nodal, organ.rest.position, organ.u, some_nodes);
    EXPECT_LT(largest(force(Eigen::all, some_nodes) - expected), 1e-6 * largest(expected));
    EXPECT_GT(largest(expected), 0);
}

TEST(EffectForces, PressureIsTheGradientOfItsWork) {
    Effects effects;
    effects.pressures.push_back({Organ().faces, 1.3});
    expect_gradient(effects);
}

TEST(EffectForces, MembraneTensionIsTheGradientOfItsEnergy) {
    Effects effects;
    effects.membranes.push_back({Organ().faces, 40.0, 0.5});
    expect_gradient(effects);
}

TEST(EffectForces, SlidingPairsPullAlongTheirNormalOnly) {
    Effects effects;
    const Vector3d n = Vector3d(1, -2, 0.5).normalized();
    effects.sliding = {{0, 17, n, 3.0}, {40, 62, Vector3d::UnitZ(), 5.0}, {99, 124, n, 1.0}, {3, 17, n, 2.0}};
    expect_gradient(effects);
}

TEST(EffectForces, PairsThatMayPartPressAndDoNotPull) {
    Effects effects;
    const Vector3d n = Vector3d(1, -2, 0.5).normalized();
    effects.parting = {{0, 17, n, 3.0}, {17, 0, n, 4.0}, {40, 62, Vector3d::UnitZ(), 5.0}, {62, 40, -n, 2.0}};
    expect_gradient(effects);
    const Organ organ;
    Matrix3Xd u = Matrix3Xd::Zero(3, organ.rest.node_count);
    effects.parting = {{0, 17, n, 3.0}};
    const SurfaceEffects surface = nodal_effects(effects, organ.rest).surface;
    u.col(0) = 0.2 * n;
    const Matrix3Xd pressed = surface_force(surface, organ.rest.position, u);
    EXPECT_LT((pressed.col(0) + 0.6 * n).norm(), 1e-12);
    EXPECT_LT((pressed.col(17) - 0.6 * n).norm(), 1e-12);
    u.col(0) *= -1;
    EXPECT_TRUE(surface_force(surface, organ.rest.position, u).isZero(0.0));
    effects.parting = {{0, 17, {1, 1, 0}, 3.0}};
    EXPECT_THROW(nodal_effects(effects, organ.rest), InvalidInput);
}

TEST(EffectForces, DecidedPairsHoldTogetherOrAreGone) {
    const Organ organ;
    Effects effects;
    effects.sliding = {{3, 17, Vector3d::UnitX(), 2.0}};
    effects.parting = {{0, 17, Vector3d::UnitX(), 3.0}, {40, 62, Vector3d::UnitZ(), 5.0}};
    const SurfaceEffects decided = with_pairs_decided(nodal_effects(effects, organ.rest).surface, {false, true});
    effects.sliding.push_back(effects.parting.back());
    effects.parting.clear();
    const SurfaceEffects expected = nodal_effects(effects, organ.rest).surface;
    EXPECT_EQ(decided.node, expected.node);
    EXPECT_TRUE(decided.parting.empty());
    EXPECT_EQ(surface_force(decided, organ.rest.position, organ.u),
              surface_force(expected, organ.rest.position, organ.u));
}

TEST(EffectForces, FluidLiftIsTheGradientOfItsEnergy) {
    Effects effects;
    effects.fluid = Fluid{1e-6, {1000, 2000, -9000}, 4.0};
    expect_gradient(effects);
}

// A failure looks like: a pressure that is taken from the rest configuration, whose resultant on a stretched face is
// too small.
TEST(EffectForces, PressureGrowsWithTheFaceAndTurnsWithIt) {
    const meshing::TetMesh box = meshing::box_mesh({10, 10, 10}, {2, 2, 2});
    Model model;
    model.mesh = box;
    model.materials = {{1, neo_hookean_iso(3, 0.4)}};
    model.element = Element::T4;
    const RestState rest = rest_state(model);
    const Matrix3Xi faces = boundary_faces(box);
    Matrix3Xi top(3, 0);
    for (Eigen::Index f = 0; f < faces.cols(); ++f)
        if (box.nodes(2, faces(0, f)) + box.nodes(2, faces(1, f)) + box.nodes(2, faces(2, f)) > 29.9) {
            top.conservativeResize(3, top.cols() + 1);
            top.rightCols(1) = faces.col(f);
        }
    Effects effects;
    effects.pressures.push_back({top, 2.0});
    const Eigen::Matrix3d R = Eigen::AngleAxisd(0.5, Vector3d::UnitX()).toRotationMatrix();
    Eigen::Matrix3d F = R * Eigen::DiagonalMatrix<double, 3>(1.2, 1.5, 0.9);
    const Matrix3Xd u = (F - Eigen::Matrix3d::Identity()) * box.nodes;
    const Vector3d sum = surface_force(nodal_effects(effects, rest).surface, rest.position, u).rowwise().sum();
    EXPECT_LT((sum + 2.0 * 100 * 1.2 * 1.5 * R.col(2)).norm(), 1e-9);
}

DistanceGrid sampled(const Vector3d& origin, double step, int samples,
                     const std::function<double(Vector3d)>& distance) {
    DistanceGrid grid{origin, step * Eigen::Matrix3d::Identity(), {samples, samples, samples}, {}};
    for (int k = 0; k < samples; ++k)
        for (int j = 0; j < samples; ++j)
            for (int i = 0; i < samples; ++i)
                grid.distance.push_back(static_cast<float>(distance(origin + step * Vector3d(i, j, k))));
    return grid;
}

TEST(EffectForces, DistanceToABallIsSmoothAndShifts) {
    Obstacle ball{sampled({-12, -12, -12}, 1.0, 25, [](const Vector3d& x) { return x.norm() - 8; }), {{3, -1, 2}}, 0};
    const Vector3d x = Vector3d(3, -1, 2) + 7.4 * Vector3d(1, 2, -2) / 3;
    const Distance d = distance_to(ball, x);
    EXPECT_NEAR(d.value, -0.6, 1e-3);  // the ball is eight samples in radius
    EXPECT_LT((d.gradient - Vector3d(1, 2, -2) / 3).norm(), 5e-3);
    for (int c = 0; c < 3; ++c) {
        const Vector3d h = 1e-4 * Vector3d::Unit(c);
        EXPECT_NEAR(d.gradient[c], (distance_to(ball, x + h).value - distance_to(ball, x - h).value) / 2e-4, 1e-6);
    }
    EXPECT_EQ(distance_to(ball, Vector3d(40, 0, 0)).value, std::numeric_limits<double>::infinity());
}

TEST(EffectForces, ContactStopsWhatComesInAndRubsAlongTheSurface) {
    const DistanceGrid half_space = sampled({-8, -8, -8}, 2.0, 9, [](const Vector3d& x) { return x.z(); });
    const Vector3d X(1, 1, 1);
    const Motion free{{0.3, 0, -1.2}, {0.05, 0, -0.5}};  // 0.2 mm inside
    const Motion smooth = in_contact({{half_space, {}, 0.0}}, X, free, 1);
    EXPECT_LT((smooth.u - Vector3d(0.3, 0, -1.0)).norm(), 1e-6);
    EXPECT_LT((smooth.v - Vector3d(0.05, 0, -0.3)).norm(), 1e-6);
    const Motion rubbed = in_contact({{half_space, {}, 0.1}}, X, free, 1);
    EXPECT_NEAR(rubbed.v.x(), 0.05 - 0.1 * 0.2, 1e-6);
    const Motion held = in_contact({{half_space, {}, 0.5}}, X, free, 1);
    EXPECT_NEAR(held.v.x(), 0, 1e-9);
    const Motion leaving = in_contact({{half_space, {}, 0.5}}, X, {{0, 0, -0.9}, {0, 0, 0.1}}, 1);
    EXPECT_EQ(leaving.u.z(), -0.9);
    // A body that goes faster than the node, by 0.75 mm a step, drags it along, and not up.
    const Motion dragged = in_contact({{half_space, {}, 0.1, {{8, 0, 5}}}}, X, free, 0.1);
    EXPECT_NEAR(dragged.v.x(), 0.05 + 0.1 * 0.2, 1e-6);
    EXPECT_NEAR(dragged.v.z(), -0.3, 1e-6);
    const Motion carried = in_contact({{half_space, {}, 0.5, {{1, 0.5, 0}}}}, X, free, 0.1);
    EXPECT_LT((carried.v - Vector3d(0.1, 0.05, -0.3)).norm(), 1e-6);
}

// A body that has turned is looked at in its own frame, and its normal turned back.
TEST(EffectForces, DistanceToATurnedBodyIsThatInItsOwnFrame) {
    Obstacle box{sampled({-12, -12, -12}, 1.0, 25,
                         [](const Vector3d& x) { return std::max(std::abs(x[0]) - 3, std::abs(x[1]) - 8); })};
    const Obstacle at_rest = box;
    const Eigen::Matrix3d R = Eigen::AngleAxisd(2.3, Vector3d(2, -1, 2) / 3).toRotationMatrix();
    box.placement = {{4, 5, -300}, R};
    for (const Vector3d& X : {Vector3d(3.4, 1, 2), Vector3d(-2.7, -4, 0), Vector3d(0.3, 8.6, 1)}) {
        const Vector3d x = R * X + box.placement.shift;
        const Distance turned = distance_to(box, x), rest = distance_to(at_rest, X);
        EXPECT_NEAR(turned.value, rest.value, 1e-9);
        EXPECT_LT((turned.gradient - R * rest.gradient).norm(), 1e-9);
    }
}

TEST(EffectForces, FrictionIsRelativeToTheBodyAtTheContactPoint) {
    const DistanceGrid half_space = sampled({-8, -8, -8}, 2.0, 9, [](const Vector3d& x) { return x.z(); });
    const Vector3d X(1, 1, 1);
    const Motion free{{0.3, 0, -1.2}, {0.05, 0, -0.5}};  // at (1.3, 1, −0.2)
    // About z through (1, 0, 0), so that the body has ω (−1, 0.3, 0) there, and along x with 2 mm/s.
    const Vector3d spin(0, 0, 3), velocity = Vector3d(2, 0, 0) - spin.cross(Vector3d(1, 0, 0));
    const Motion carried = in_contact({{half_space, {}, 5.0, {velocity, spin}}}, X, free, 0.01);
    EXPECT_LT((carried.v - Vector3d(0.01 * (2 - 3), 0.01 * 3 * 0.3, -0.3)).norm(), 1e-6);
}

TEST(EffectForces, NonsenseIsRefusedByName) {
    const Organ organ;
    const auto message_of = [&](const Effects& effects) -> std::string {
        try {
            nodal_effects(effects, organ.rest);
        } catch (const InvalidInput& error) {
            return error.what();
        }
        return "accepted";
    };
    Effects effects;
    effects.pressures.push_back({organ.faces, std::nan("")});
    EXPECT_THAT(message_of(effects), HasSubstr("pressure (kPa) is not finite"));
    effects = {};
    effects.membranes.push_back({Matrix3Xi::Constant(3, 1, 5), 1.0, 1.0});
    EXPECT_THAT(message_of(effects), HasSubstr("without area"));
    effects = {};
    effects.membranes.push_back({organ.faces, -1.0, 1.0});
    EXPECT_THAT(message_of(effects), HasSubstr("must be positive"));
    effects = {};
    effects.sliding = {{0, 7000, Vector3d::UnitX(), 1.0}};
    EXPECT_THAT(message_of(effects), HasSubstr("node 7000"));
    effects = {};
    effects.sliding = {{0, 7, {1, 1, 0}, 1.0}};
    EXPECT_THAT(message_of(effects), HasSubstr("unit vector"));
    effects = {};
    effects.fluid = Fluid{};
    EXPECT_THAT(message_of(effects), HasSubstr("gravity"));
    effects = {};
    effects.contact =
        RigidContact{{0}, {Obstacle{DistanceGrid{{}, Eigen::Matrix3d::Identity(), {3, 9, 9}, {}}, {}, 0}}};
    EXPECT_THAT(message_of(effects), HasSubstr("needs 4"));
    const DistanceGrid far = sampled({-8, -8, -8}, 2.0, 9, [](const Vector3d&) { return 1.0; });
    effects.contact = RigidContact{{0}, {{far, {{0, 0, 0}, 2 * Eigen::Matrix3d::Identity()}, 0}}};
    EXPECT_THAT(message_of(effects), HasSubstr("proper orthogonal"));
}

TEST(EffectForces, ConditionsWithEffectsNeedTheRestState) {
    Conditions conditions;
    conditions.effects.fluid = Fluid{1e-6, {0, 0, -9810}, 0};
    EXPECT_THROW(nodal_conditions(conditions, 12), InvalidInput);
    EXPECT_TRUE(nodal_conditions(conditions, Organ().rest).effects.fluid);
}

}  // namespace
}  // namespace tissuewarp::tled
