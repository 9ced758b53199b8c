/// Every effect against its verification case, on the engines.
#include "tests/verification/effect_engines.hpp"
#include "tests/verification/problems.hpp"
#include "tests/verification/solution.hpp"
#include "tled/contact.hpp"
#include "tled/engine_choice.hpp"

#include "core/errors.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::verification {
namespace {

INSTANTIATE_TEST_SUITE_P(All, Effects,
                         ::testing::Combine(::testing::ValuesIn(all_engines), ::testing::ValuesIn(effect_cases())),
                         name_of_effect);

TEST_P(Effects, AnswersAsTheReference) {
    const auto& [engine, effect] = GetParam();
    if (engine.name == all_engines.back().name && effect.effect == "pressure" && !tled::has_gpu())
        GTEST_SKIP() << "some minutes on a software rasteriser; effects_engine_test.cpp has its forces there";
    EXPECT_NEAR(effect.measure(engine.make), effect.reference, effect.bound)
        << effect.scene << ", " << effect.quantity << " (" << effect.unit << "), from " << effect.source;
}

tled::DistanceGrid below_plane(double height) {
    tled::DistanceGrid grid{{-80, -80, height - 40}, 16 * Eigen::Matrix3d::Identity(), {11, 11, 11}, {}};
    for (int k = 0; k < 11; ++k) grid.distance.insert(grid.distance.end(), 11 * 11, static_cast<float>(40 - 16 * k));
    return grid;
}

// A half ball pressed by a tenth of its radius: rounds of springs against Newton's method with exactly imposed nodes.
// A failure looks like: nodes that hang on the plane, or other nodes that touch it.
TEST(Contact, RoundsOfSpringsFindTheActiveSetsSolution) {
    const Problem problem = half_ball_contact(Law::Iso, 5);
    const Solution expected = solve(problem, Elements::T4, 6);
    const tled::RestState rest = tled::rest_state(linear_model(problem, Elements::T4, expected.mesh));
    tled::NodalConditions conditions = nodal_conditions_of(problem, expected.mesh);
    tled::RigidContact contact;
    for (int a = 0; a < rest.node_count; ++a)
        if (problem.may_touch(rest.position.col(a))) contact.nodes.push_back(a);
    contact.obstacles.push_back({below_plane(problem.plane_height(problem.stages)), {}, 0});
    tled::Effects effects;
    effects.contact = contact;
    conditions.effects = tled::nodal_effects(effects, rest);
    const auto engine = tled::make_cpu_engine(rest, tled::Scalar::Float64);
    tled::ContactOptions options;
    options.equilibrium.tolerance_mm = 1e-4;
    options.penetration_mm = 1e-4;
    const tled::ContactResult found = tled::equilibrium_in_contact(*engine, rest, conditions, options);
    EXPECT_LT((found.equilibrium.displacement - expected.displacement).colwise().norm().maxCoeff(), 2e-3);
    EXPECT_GT(found.touching, 5);
    EXPECT_LT(found.largest_penetration_mm, 2e-4);
    double off = 0, force = 0;
    for (int a = 0; a < rest.node_count; ++a) {
        if (found.reaction(2, a) == 0) continue;
        off = std::max(off, std::abs(found.reaction(2, a) - expected.force(2, a)));
        force = std::max(force, std::abs(expected.force(2, a)));
    }
    EXPECT_LT(off, 1e-4 * force);
}

TEST(Contact, FrictionIsRefusedInAnEquilibrium) {
    const Problem problem = half_ball_contact(Law::Iso, 5);
    const tled::RestState rest = tled::rest_state(linear_model(problem, Elements::T4, problem.mesh(4)));
    tled::NodalConditions conditions = nodal_conditions_of(problem, problem.mesh(4));
    const auto engine = tled::make_cpu_engine(rest);
    EXPECT_THROW(tled::equilibrium_in_contact(*engine, rest, conditions), InvalidInput);
    tled::Effects effects;
    effects.contact = tled::RigidContact{{0}, {{below_plane(60), {}, 0.1}}};
    conditions.effects = tled::nodal_effects(effects, rest);
    EXPECT_THROW(tled::equilibrium_in_contact(*engine, rest, conditions), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::verification
