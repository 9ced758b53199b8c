/// Slender tissue that hangs far down: where float32 forces end, Newton's method decides.
#include "tled/load_path.hpp"

#include "core/errors.hpp"
#include "tests/tled/equilibrium_scenes.hpp"
#include "tled/reference/newton.hpp"
#include "tled/stiffness/tangent_factor.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3Xd;

/// Of 400 × 40 × 40 mm, held at one end, under its weight across; linear elasticity lets it hang by six lengths.
struct Rod {
    Model model;
    RestState rest;
    NodalConditions conditions;

    explicit Rod(double weight = 1) {
        model.mesh = meshing::box_mesh({400, 40, 40}, {20, 2, 2});
        model.materials[1] = NeoHookeanLnJ{5.0, 20.0};
        model.density = 1e-6;
        rest = rest_state(model);
        Conditions hanging;
        hanging.external_force = Matrix3Xd::Zero(3, rest.node_count);
        for (int n = 0; n < rest.node_count; ++n) {
            if (rest.position(0, n) < 1e-6) hanging.prescribed.push_back({n, {true, true, true}, {0, 0, 0}});
            hanging.external_force(1, n) = -weight * 9810 * rest.lumped_mass[n];
        }
        conditions = nodal_conditions(hanging, rest.node_count);
    }
};

class LargeRotations : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(ToEveryTolerance, LargeRotations, ::testing::Values(1.0, 0.5, 0.1, 0.05, 0.01),
                         [](const auto& each) { return std::to_string(int(1000 * each.param)) + "um"; });

TEST_P(LargeRotations, ArriveWhereNewtonInSmallStepsDoes) {
    const Rod rod;
    const RestStiffness stiffness(rod.rest, rod.conditions);
    const auto engine = make_cpu_engine(rod.rest, Scalar::Float32);
    const EquilibriumResult found = equilibrium_along_load(
        *engine, stiffness, rod.conditions, {.equilibrium = {.tolerance_mm = GetParam(), .rest = &rod.rest}});
    static const Matrix3Xd truth =
        newton_equilibrium(rod.rest, rod.conditions, {.tolerance_mm = 1e-8, .load_steps = 40}).displacement;
    EXPECT_GT(truth.colwise().norm().maxCoeff(), 200);
    EXPECT_LT(largest_difference(found.displacement, truth), GetParam());
    EXPECT_LE(found.estimated_error_mm, GetParam());
    EXPECT_EQ(found.method, EquilibriumMethod::Newton);
    EXPECT_LT(largest_difference(engine->displacement(), truth), GetParam() + 1e-3);
}

// A start that is nearly right saves the path; one that is far off, or none, does not prevent it.
TEST(LargeRotation, BeginsWithACoarseStart) {
    const Rod rod;
    const RestStiffness stiffness(rod.rest, rod.conditions);
    const auto engine = make_cpu_engine(rod.rest, Scalar::Float32);
    const Matrix3Xd truth =
        newton_equilibrium(rod.rest, rod.conditions, {.tolerance_mm = 1e-8, .load_steps = 40}).displacement;
    int asked = 0;
    const auto evaluations_from = [&](const std::optional<CoarseStart>& start) {
        asked = 0;
        const auto found =
            equilibrium_along_load(*engine, stiffness, rod.conditions,
                                   {.equilibrium = {.tolerance_mm = 0.05, .rest = &rod.rest}, .coarse_start = [&] {
                                        ++asked;
                                        return start;
                                    }});
        EXPECT_EQ(asked, 1);
        EXPECT_LT(largest_difference(found.displacement, truth), 0.05);
        return found.force_evaluations;
    };
    const int from_near = evaluations_from(CoarseStart{0.95 * truth, EquilibriumMethod::Newton});
    EXPECT_LT(3 * from_near, evaluations_from(std::nullopt));
    evaluations_from(CoarseStart{-3 * truth, EquilibriumMethod::Newton});
    evaluations_from(CoarseStart{0.95 * truth, EquilibriumMethod::Lbfgs});
}

// What the escalation is for: without it the same rod is refused.
TEST(LargeRotation, IsRefusedWithoutNewton) {
    const Rod rod;
    const RestStiffness stiffness(rod.rest, rod.conditions);
    const auto engine = make_cpu_engine(rod.rest, Scalar::Float32);
    const LoadPathOptions options{
        .equilibrium = {.tolerance_mm = 0.05, .last = EquilibriumMethod::Lbfgs, .rest = &rod.rest}};
    EXPECT_THROW(equilibrium_along_load(*engine, stiffness, rod.conditions, options), SolverFailure);
}

TEST(LargeRotation, NewtonNeedsTheRestState) {
    const Rod rod(0.01);
    const RestStiffness stiffness(rod.rest, rod.conditions);
    const auto engine = make_cpu_engine(rod.rest, Scalar::Float32);
    EXPECT_THROW(equilibrium(*engine, stiffness, rod.conditions, {.method = EquilibriumMethod::Newton}), InvalidInput);
}

// K of a rod that is pressed beyond its buckling load is indefinite: without what is negative it leads downhill.
TEST(TangentFactor, OfAnIndefiniteTangentLeadsDownhill) {
    const Rod rod;
    Matrix3Xd pressed = Matrix3Xd::Zero(3, rod.rest.node_count);
    detail::TangentFactor tangent(rod.rest, rod.conditions.constrained);
    ASSERT_TRUE(tangent.factorise(rod.conditions, pressed));
    EXPECT_TRUE(tangent.stable());
    pressed.row(0) = -0.3 * rod.rest.position.row(0);
    ASSERT_TRUE(tangent.factorise(rod.conditions, pressed));
    EXPECT_FALSE(tangent.stable());
    Matrix3Xd force = Matrix3Xd::Zero(3, rod.rest.node_count);
    force.row(2).setConstant(1);
    EXPECT_GT(tangent.solve(force).cwiseProduct(rod.conditions.constrained.select(0.0, force)).sum(), 0);
}

}  // namespace
}  // namespace tissuewarp::tled
