/// Self-checked relaxation where it could be misled: by springs and eigenvalues of another state, and by loads that
/// tear.
#include "tests/tled/engine_scene.hpp"
#include "tests/tled/equilibrium_scenes.hpp"
#include "tled/reference/newton.hpp"

#include <gmock/gmock.h>

#include <cmath>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3Xd;

/// Tissue that springs on all its surface pull to a bent and swollen shape, as a label map does in a registration.
struct PulledBox {
    Model model;
    RestState rest;
    explicit PulledBox(double poisson) {
        model.mesh = meshing::box_mesh({60, 60, 60}, {6, 6, 6}, 0.2, 1);
        model.materials[1] = neo_hookean_lnj(3.0, poisson);
        model.element = Element::AveragedPressureT4;
        rest = rest_state(model);
    }
    /// Springs of so many mN/mm on the surface up to a height, mm.
    [[nodiscard]] NodalConditions pulled(double stiffness, double height = 60) const {
        Conditions springs;
        for (int node = 0; node < rest.node_count; ++node) {
            const Eigen::Vector3d X = model.mesh.nodes.col(node);
            if (((X.array() > 1e-9).all() && (X.array() < 60 - 1e-9).all()) || X[2] > height + 1e-9) continue;
            const Eigen::Vector3d pull(0.002 * X[2] * X[2], 0.05 * X[1], 2);
            springs.springs.push_back({node, stiffness * Eigen::Matrix3d::Identity(), pull});
        }
        return nodal_conditions(springs, rest.node_count);
    }
};

/// Springs told and springs that act.
void expect_tolerance_kept(const PulledBox& box, const NodalConditions& told, const NodalConditions& conditions) {
    const RestStiffness stiffness(box.rest, told);
    const auto engine = make_cpu_engine(box.rest, Scalar::Float64);
    const Matrix3Xd newton = newton_equilibrium(box.rest, conditions, {.tolerance_mm = 1e-8}).displacement;
    for (const double tolerance : {0.3, 0.03, 0.003}) {
        const auto found = equilibrium(*engine, stiffness, conditions,
                                       {.tolerance_mm = tolerance, .method = EquilibriumMethod::SelfCheckedRelaxation});
        EXPECT_EQ(found.lifted_residuals, 0);
        EXPECT_LT(largest_difference(found.displacement, newton), tolerance) << found.force_evaluations;
    }
}

// No solve is made, and what the method is told of the springs may be wrong: its estimate of the error must not be.
TEST(SelfCheckedRelaxation, KeepsItsToleranceUnderOtherSpringsThanThoseFactorised) {
    for (const double poisson : {0.3, 0.49}) {
        const PulledBox box(poisson);
        for (const double held : {0.03, 3.0, 30.0, 300.0, 30000.0}) {
            SCOPED_TRACE("nu " + std::to_string(poisson) + ", springs " + std::to_string(held));
            expect_tolerance_kept(box, box.pulled(30), box.pulled(held));
        }
    }
}

TEST(SelfCheckedRelaxation, KeepsItsToleranceWhereSpringsAreMissing) {
    for (const double poisson : {0.3, 0.49}) {
        const PulledBox box(poisson);
        for (const double height : {50.0, 30.0, 10.0, 0.0}) {
            SCOPED_TRACE("nu " + std::to_string(poisson) + ", springs up to " + std::to_string(height));
            expect_tolerance_kept(box, box.pulled(30), box.pulled(30, height));
        }
    }
}

// Steps that are too long for the stiffest element grow until tissue is torn: what was known of another state must not
// decide.
TEST(SelfCheckedRelaxation, TakesAKnownHighestEigenvalueUntilItProvesWrong) {
    for (const double poisson : {0.3, 0.49}) {
        const PulledBox box(poisson);
        const NodalConditions conditions = box.pulled(30);
        const RestStiffness stiffness(box.rest, conditions);
        const auto engine = make_cpu_engine(box.rest, Scalar::Float64);
        const Matrix3Xd newton = newton_equilibrium(box.rest, conditions, {.tolerance_mm = 1e-8}).displacement;
        const auto solved = [&](double known) {
            return equilibrium(
                *engine, stiffness, conditions,
                {.tolerance_mm = 0.003, .method = EquilibriumMethod::SelfCheckedRelaxation, .known_highest = known});
        };
        const auto found = solved(0);
        const auto again = solved(found.highest);
        EXPECT_EQ(again.highest, found.highest);
        EXPECT_LE(again.force_evaluations, found.force_evaluations);
        for (const double part : {1.0, 0.9, 0.8, 0.6, 0.3, 0.01, 3.0}) {
            const auto other = solved(part * found.highest);
            EXPECT_LT(largest_difference(other.displacement, newton), 0.003) << part;
        }
        EXPECT_NEAR(solved(0.3 * found.highest).highest, found.highest, 0.1 * found.highest) << "it is found anew";
    }
}

// Tissue at rest but for its top, which is 20 mm away, is torn: from there on fine meshes steps lead nowhere.
TEST(SelfCheckedRelaxation, StartsWhereImposedDisplacementsDoNotTear) {
    const SeedCube cube(Element::AveragedPressureT4, 15);
    const RestStiffness stiffness(cube.rest, cube.conditions);
    const auto engine = make_cpu_engine(cube.rest, Scalar::Float32);
    Listener listener;
    const auto solved = [&](EquilibriumMethod method, double tolerance) {
        return equilibrium(*engine, stiffness, cube.conditions, {.tolerance_mm = tolerance, .method = method}, nullptr,
                           listener);
    };
    const auto found = solved(EquilibriumMethod::SelfCheckedRelaxation, 0.05);
    EXPECT_TRUE(listener.notes.empty()) << "factorised: " << listener.notes.front();
    EXPECT_EQ(found.lifted_residuals, 0);
    EXPECT_LT(largest_difference(found.displacement, solved(EquilibriumMethod::Lbfgs, 0.003).displacement), 0.05);
}

// Springs stiffer than the layer of tissue that they pull at press it through the next one.
TEST(SelfCheckedRelaxation, BeginsWithAPartOfLoadsThatTearTissueAtOnce) {
    constexpr double height = 60, pressed = 12;  // mm
    Model model;
    model.mesh = meshing::box_mesh({20, 20, height}, {3, 3, 60});
    model.materials[1] = neo_hookean_lnj(3.0, 0.3);
    const RestState rest = rest_state(model);
    Conditions held;
    for (int node = 0; node < rest.node_count; ++node) {
        const double z = model.mesh.nodes(2, node);
        if (z < 1e-9) held.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
        if (z > height - 1e-9) held.springs.push_back({node, 500 * Eigen::Matrix3d::Identity(), {0, 0, -pressed}});
    }
    const NodalConditions conditions = nodal_conditions(held, rest.node_count);
    const RestStiffness stiffness(rest, conditions);
    const auto engine = make_cpu_engine(rest, Scalar::Float64);
    Listener listener;
    const auto found =
        equilibrium(*engine, stiffness, conditions,
                    {.tolerance_mm = 0.01, .method = EquilibriumMethod::SelfCheckedRelaxation}, nullptr, listener);
    const Matrix3Xd exact =
        newton_equilibrium(rest, conditions, {.tolerance_mm = 1e-8, .start = found.displacement}).displacement;
    EXPECT_LT(largest_difference(found.displacement, exact), 0.01) << found.force_evaluations;
    EXPECT_THAT(listener.notes, ::testing::ElementsAre(::testing::HasSubstr("a part of them")));
}

}  // namespace
}  // namespace tissuewarp::tled
