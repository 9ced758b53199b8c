// Stiff beside soft, slivers, and springs from a breath to a wall.

#include "meshing/quality.hpp"
#include "tests/stability/hard_cases.hpp"
#include "tled/critical_step.hpp"
#include "tled/dynamics.hpp"

namespace tissuewarp::stability {
namespace {

using Contrast = OnEveryEngine;
INSTANTIATE_TEST_SUITE_P(All, Contrast, every_engine, engine_name);

// Two layers in series, the lower 10⁴ times stiffer: nearly all of the motion is in the upper. A failure looks like: no
// convergence (the spectrum spans eight decades), float32 noise of the stiff part in the soft one, pressure smeared
// over the interface. Tolerance 0.02 mm of 3 mm.
TEST_P(Contrast, AnInterfaceOfTenThousandToOne) {
    tled::Model model = box({30, 30, 30}, {4, 4, 6}, tled::neo_hookean_lnj(3.0, 0.45));
    for (int t = 0; t < model.mesh.tet_count(); ++t) {
        double z = 0;
        for (const int node : model.mesh.tets.col(t)) z += model.mesh.nodes(2, node) / 4;
        model.mesh.labels[t] = z < 15 ? 2 : 1;
    }
    model.materials[2] = tled::neo_hookean_lnj(3e4, 0.45);
    const tled::RestState rest = tled::rest_state(model);
    const tled::NodalConditions conditions = between_plates(model, {0, 0, -3});
    const Matrix3Xd truth = by_newton(rest, conditions);
    const Matrix3Xd u = solved(GetParam(), rest, conditions, 0.01);
    EXPECT_LT(distance(u, truth), 0.02);
    for (int node = 0; node < rest.node_count; ++node)
        if (model.mesh.nodes(2, node) < 15 + 1e-9) {
            EXPECT_LT(u.col(node).norm(), 0.01) << "the stiff half stays";
        }
}

// A failure looks like: an inverted sliver, a step so small that nothing converges, a bump around the slivers. The
// sliver's own node is free to move in its flat elements: 0.1 mm of 6 mm.
TEST_P(Contrast, SliversOfHalfADegreeAreSurvived) {
    const tled::Model model = with_slivers();
    ASSERT_LT(meshing::dihedral_angles(model.mesh).row(0).minCoeff(), 0.6);
    const tled::RestState rest = tled::rest_state(model);
    const tled::NodalConditions conditions = between_plates(model, {3, 0, 5});
    const Matrix3Xd truth = by_newton(rest, conditions, 4);
    EXPECT_LT(distance(solved_in_parts(GetParam(), rest, conditions, 0.02), truth), 0.1);
}

// Dynamics with slivers: the step is theirs unless mass is added; both runs stay stable. A failure looks like: energy
// that grows, or a run that needs 20 times the steps with mass scaling too.
TEST_P(Contrast, MassScalingTakesTheStepBackFromSlivers) {
    const tled::Model model = with_slivers();
    const tled::RestState rest = tled::rest_state(model);
    const tled::NodalConditions conditions = between_plates(model, {0, 0, 0});
    tled::DynamicsState state{Matrix3Xd::Zero(3, rest.node_count), Matrix3Xd::Zero(3, rest.node_count), 0};
    state.velocity.row(0).setConstant(50);  // mm/s
    const auto engine = make_engine(GetParam(), rest);
    const Matrix3Xd plain = rest.lumped_mass.transpose().replicate(3, 1);
    const auto slow = tled::dynamics(*engine, rest, plain, conditions, state, 0.02);
    const double ordinary =
        tled::element_step_bounds(tled::rest_state(box({40, 40, 40}, {4, 4, 4}, model.materials.at(1))), model.density)
            .minCoeff();
    const tled::MassScaling scaling = tled::scaled_mass(rest, model.density, ordinary);
    const auto fast = tled::dynamics(*engine, rest, scaling.mass, conditions, state, 0.02);
    EXPECT_LT(fast.steps, 0.3 * slow.steps);
    EXPECT_LT(slow.energy.largest_growth, 0.02);
    EXPECT_LT(fast.energy.largest_growth, 0.02);
    EXPECT_TRUE(fast.state.displacement.allFinite());
}

// Springs on the top face, kPa/mm times the area of a node, pulling by 2 mm: from nothing to a wall. A failure looks
// like: a step that the stiff springs make unstable, soft springs that never arrive, float32 that cannot tell the
// tissue beside the wall. Tolerance 0.02 mm.
TEST_P(Contrast, SpringsFromAThousandthToAMillionKilopascalPerMillimetre) {
    const tled::Model model = box({30, 30, 30}, {4, 4, 4}, tled::neo_hookean_lnj(3.0, 0.45));
    const tled::RestState rest = tled::rest_state(model);
    for (const double stiffness : {1e-3, 1.0, 1e3, 1e6}) {
        tled::Conditions conditions;
        for (int node = 0; node < rest.node_count; ++node) {
            const double z = model.mesh.nodes(2, node);
            if (z == 0) conditions.prescribed.push_back({node, {true, true, true}, Vector3d::Zero()});
            if (z > 30 - 1e-9)
                conditions.springs.push_back({node, stiffness * 56.25 * Matrix3d::Identity(), {0.5, 0, -2}});
        }
        const tled::NodalConditions nodal = tled::nodal_conditions(conditions, rest.node_count);
        const Matrix3Xd truth = by_newton(rest, nodal);
        EXPECT_LT(distance(solved(GetParam(), rest, nodal, 0.01), truth), 0.02) << stiffness;
    }
}

}  // namespace
}  // namespace tissuewarp::stability
