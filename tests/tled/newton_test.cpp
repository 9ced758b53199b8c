#include "tled/reference/newton.hpp"
#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "tled/model/internal_force.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>
#include <limits>
#include <vector>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

// Seed's material: λ 49.329 kPa, μ 1.007 kPa.
const NeoHookeanIso seed_iso{1.007, 49.329 + 2.0 / 3.0 * 1.007};

Model box(Element element, const Material& material, double jitter) {
    Model model;
    model.mesh = meshing::box_mesh({100.0, 100.0, 100.0}, {4, 4, 4}, jitter, 2);
    model.materials[1] = material;
    model.element = element;
    return model;
}

// Three faces on rollers, the top moved along z: free lateral contraction.
Conditions rollers(const Model& model, double lift_mm) {
    Conditions conditions;
    for (int i = 0; i < model.mesh.node_count(); ++i) {
        const Vector3d x = model.mesh.nodes.col(i);
        const bool top = x.z() > 100 - 1e-9;
        const std::array<bool, 3> fixed{x.x() < 1e-9, x.y() < 1e-9, x.z() < 1e-9 || top};
        if (!fixed[0] && !fixed[1] && !fixed[2]) continue;
        conditions.prescribed.push_back({i, fixed, Vector3d(0.0, 0.0, top ? lift_mm : 0.0)});
    }
    return conditions;
}

// Both ends bonded, the top moved.
Conditions bonded(const Model& model, const Vector3d& top_mm) {
    Conditions conditions;
    for (int i = 0; i < model.mesh.node_count(); ++i) {
        const double z = model.mesh.nodes(2, i);
        if (z < 1e-9) conditions.prescribed.push_back({i, {true, true, true}, Vector3d::Zero()});
        if (z > 100 - 1e-9) conditions.prescribed.push_back({i, {true, true, true}, top_mm});
    }
    return conditions;
}

double top_force(const Model& model, const Matrix3Xd& force) {
    double sum = 0.0;
    for (int i = 0; i < model.mesh.node_count(); ++i) {
        if (model.mesh.nodes(2, i) > 100 - 1e-9) sum += force(2, i);
    }
    return sum;
}

class NewtonTest : public testing::TestWithParam<Element> {};

INSTANTIATE_TEST_SUITE_P(Elements, NewtonTest, testing::Values(Element::T4, Element::AveragedPressureT4),
                         [](const auto& each) { return each.param == Element::T4 ? "T4" : "AveragedPressure"; });

struct FreeStretch {
    double stretch, lateral, force_mN;
};

// Closed form of the isochoric law, see constitutive_test.cpp; any mesh reproduces a homogeneous state.
TEST_P(NewtonTest, FreeStretchMeetsTheClosedForm) {
    const Model model = box(GetParam(), seed_iso, 0.1);
    const RestState rest = rest_state(model);
    for (const FreeStretch& state : {FreeStretch{1.1, 0.95441615, 2734.385}, FreeStretch{1.3, 0.87972376, 7067.488},
                                     FreeStretch{0.8, 1.11574604, -7634.868}}) {
        const NodalConditions c = nodal_conditions(rollers(model, 100 * (state.stretch - 1)), rest.node_count);
        const Matrix3Xd u = newton_equilibrium(rest, c).displacement;
        const Vector3d strain(state.lateral - 1, state.lateral - 1, state.stretch - 1);
        EXPECT_LT((u - strain.asDiagonal() * model.mesh.nodes).cwiseAbs().maxCoeff(), 1e-6);  // mm: 8 digits given
        EXPECT_NEAR(top_force(model, internal_force(rest, u)), state.force_mN, 0.002);
    }
}

TEST_P(NewtonTest, FreeNodesAreInBalanceAndTheEnergyIsLeast) {
    const Model model = box(GetParam(), neo_hookean_lnj(3.0, 0.49), 0.1);
    const RestState rest = rest_state(model);
    const NodalConditions c = nodal_conditions(bonded(model, {5.0, 0.0, 15.0}), rest.node_count);
    const Matrix3Xd u = newton_equilibrium(rest, c).displacement;
    const Matrix3Xd force = internal_force(rest, u);
    EXPECT_LT(c.constrained.select(0.0, force).cwiseAbs().maxCoeff(), 1e-9 * force.cwiseAbs().maxCoeff());
    for (int mode = 1; mode <= 5; ++mode) {
        Matrix3Xd trial = u;
        for (int d = 0; d < u.size(); ++d) {
            if (!c.constrained.data()[d]) trial.data()[d] += 0.05 * std::sin(1.3 * mode * d);  // mm
        }
        EXPECT_GT(elastic_energy(rest, trial), elastic_energy(rest, u));
    }
}

// Stops one correction earlier each time; the errors against the converged state fall quadratically.
TEST_P(NewtonTest, ConvergesQuadratically) {
    const Model model = box(GetParam(), neo_hookean_lnj(3.0, 0.45), 0.1);
    const RestState rest = rest_state(model);
    const NodalConditions c = nodal_conditions(bonded(model, {0.0, 0.0, 20.0}), rest.node_count);
    const Matrix3Xd exact = newton_equilibrium(rest, c, {.tolerance_mm = 1e-11}).displacement;
    std::vector<double> errors;  // mm
    for (double tolerance : {1.0, 1e-2, 1e-4, 1e-6, 1e-8}) {
        const double error =
            (newton_equilibrium(rest, c, {.tolerance_mm = tolerance}).displacement - exact).cwiseAbs().maxCoeff();
        if (errors.empty() || error < 0.5 * errors.back()) errors.push_back(error);
    }
    ASSERT_GE(errors.size(), 2U);
    int quadratic = 0;
    for (std::size_t k = 1; k < errors.size(); ++k) {
        if (errors[k] < 1e-11) continue;  // rounding
        EXPECT_LT(errors[k], 1.0 * errors[k - 1] * errors[k - 1] + 1e-11) << k;
        ++quadratic;
    }
    EXPECT_GE(quadratic + (errors.back() < 1e-11 ? 1 : 0), 1);
}

TEST_P(NewtonTest, LoadStepsDoNotChangeTheAnswer) {
    const Model model = box(GetParam(), seed_iso, 0.1);
    const RestState rest = rest_state(model);
    const NodalConditions c = nodal_conditions(bonded(model, {0.0, 0.0, -10.0}), rest.node_count);
    const Matrix3Xd once = newton_equilibrium(rest, c, {.tolerance_mm = 1e-10}).displacement;
    const Matrix3Xd many = newton_equilibrium(rest, c, {.tolerance_mm = 1e-10, .load_steps = 5}).displacement;
    EXPECT_LT((once - many).cwiseAbs().maxCoeff(), 1e-9);  // mm
}

// Half of the way, then on from there: imposed displacements start where the first solution left them, forces are
// whole.
TEST_P(NewtonTest, GoesOnFromAStart) {
    const Model model = box(GetParam(), seed_iso, 0.1);
    const RestState rest = rest_state(model);
    const auto pulled = [&](double top) {
        Conditions conditions = bonded(model, {0.0, 0.0, top});
        conditions.external_force = Matrix3Xd::Constant(3, rest.node_count, 2.0);  // mN
        return nodal_conditions(conditions, rest.node_count);
    };
    NewtonOptions options{.tolerance_mm = 1e-10};
    const Matrix3Xd direct = newton_equilibrium(rest, pulled(16.0), options).displacement;
    options.start = newton_equilibrium(rest, pulled(8.0), options).displacement;
    EXPECT_LT((newton_equilibrium(rest, pulled(16.0), options).displacement - direct).cwiseAbs().maxCoeff(), 1e-9);
    options.start.resize(3, 5);
    EXPECT_THROW(static_cast<void>(newton_equilibrium(rest, pulled(16.0), options)), InvalidInput);
}

// Springs to a rotated copy: zero energy at the rigid rotation, far from the start.
TEST_P(NewtonTest, SpringsTurnTheTissueRigidly) {
    const Model model = box(GetParam(), seed_iso, 0.0);
    const RestState rest = rest_state(model);
    const Matrix3d R = Eigen::AngleAxisd(0.6, Vector3d(0.0, 0.6, 0.8)).toRotationMatrix();
    const Matrix3Xd target = R * model.mesh.nodes - model.mesh.nodes;
    Conditions conditions;
    for (int i = 0; i < rest.node_count; i += 3)
        conditions.springs.push_back({i, 2.0 * Matrix3d::Identity(), target.col(i)});
    const Matrix3Xd u = newton_equilibrium(rest, nodal_conditions(conditions, rest.node_count)).displacement;
    EXPECT_LT((u - target).cwiseAbs().maxCoeff(), 1e-8);  // mm
}

// A dead load on the free end against finite differences of the total potential.
TEST_P(NewtonTest, ExternalForceIsBalanced) {
    const Model model = box(GetParam(), neo_hookean_lnj(3.0, 0.45), 0.1);
    const RestState rest = rest_state(model);
    Conditions conditions;
    conditions.external_force = Matrix3Xd::Zero(3, rest.node_count);
    for (int i = 0; i < rest.node_count; ++i) {
        if (model.mesh.nodes(2, i) < 1e-9) conditions.prescribed.push_back({i, {true, true, true}, Vector3d::Zero()});
        if (model.mesh.nodes(2, i) > 100 - 1e-9) conditions.external_force(0, i) = 60.0;  // mN
    }
    const NodalConditions c = nodal_conditions(conditions, rest.node_count);
    const Matrix3Xd u = newton_equilibrium(rest, c).displacement;
    EXPECT_GT(u.cwiseAbs().maxCoeff(), 5.0);  // mm: far beyond the linear range
    const Matrix3Xd residual = c.constrained.select(0.0, conditions.external_force - internal_force(rest, u));
    EXPECT_LT(residual.cwiseAbs().maxCoeff(), 1e-7);  // mN
}

// The imposed displacement turns the first row of cells inside out when it is applied to the boundary alone.
TEST_P(NewtonTest, DisplacementsLargerThanACellConverge) {
    const Model model = box(GetParam(), neo_hookean_lnj(3.0, 0.4), 0.1);
    const RestState rest = rest_state(model);
    const NodalConditions c = nodal_conditions(bonded(model, {40.0, 0.0, -30.0}), rest.node_count);
    const NewtonResult result = newton_equilibrium(rest, c, {.load_steps = 4});
    EXPECT_LE(result.last_correction_mm, 1e-9);
    EXPECT_GT(jacobians(rest, result.displacement).minCoeff(), 0.0);
}

TEST_P(NewtonTest, ImpossibleLoadFailsInWords) {
    const Model model = box(GetParam(), seed_iso, 0.0);
    const RestState rest = rest_state(model);
    const NodalConditions c = nodal_conditions(bonded(model, {0.0, 0.0, -120.0}), rest.node_count);
    EXPECT_THROW(static_cast<void>(newton_equilibrium(rest, c, {.max_iterations = 30})), SolverFailure);
}

TEST(Newton, UnheldTissueAndBadOptionsAreRefused) {
    const RestState rest = rest_state(box(Element::T4, seed_iso, 0.0));
    const NodalConditions free = nodal_conditions({}, rest.node_count);
    EXPECT_THROW(static_cast<void>(newton_equilibrium(rest, free)), InvalidInput);
    EXPECT_THROW(static_cast<void>(newton_equilibrium(rest, free, {.load_steps = 0})), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::tled
