/// Dynamics on every engine: closed forms, conservation, refusals.
#include "tled/dynamics.hpp"
#include "core/errors.hpp"
#include "tests/tled/engine_scene.hpp"
#include "tled/critical_step.hpp"
#include "tled/nodal_effects.hpp"
#include "tled/stiffness/tangent_stiffness.hpp"

#include <gmock/gmock.h>
#include <Eigen/Eigenvalues>

#include <cmath>
#include <numbers>
#include <vector>

namespace tissuewarp::tled {
namespace {

using namespace scene;

/// A bar of 20 × 20 × 100 mm along z, E = 3 kPa, held at z = 0 in z alone and on the axis planes.
struct Bar {
    Model model;
    RestState rest;
    NodalConditions conditions;

    explicit Bar(int cells = 10, double poisson = 0.0) {
        model.mesh = meshing::box_mesh({20, 20, 100}, {2, 2, cells});
        model.materials[1] = neo_hookean_lnj(3.0, poisson);
        model.element = Element::T4;
        rest = rest_state(model);
        Conditions held;
        for (int node = 0; node < rest.node_count; ++node) {
            const Vector3d X = model.mesh.nodes.col(node);
            const std::array<bool, 3> on{X.x() == 0, X.y() == 0, X.z() == 0};
            if (on[0] || on[1] || on[2]) held.prescribed.push_back({node, on, Vector3d::Zero()});
        }
        conditions = nodal_conditions(held, rest.node_count);
    }
    /// u_z = A sin(π z/2L).
    [[nodiscard]] DynamicsState first_mode(double amplitude) const {
        DynamicsState state{Matrix3Xd::Zero(3, rest.node_count), Matrix3Xd::Zero(3, rest.node_count), 0};
        for (int node = 0; node < rest.node_count; ++node)
            state.displacement(2, node) = amplitude * std::sin(std::numbers::pi * model.mesh.nodes(2, node) / 200.0);
        return state;
    }
    [[nodiscard]] int tip() const { return rest.node_count - 1; }
};

class Dynamics : public ::testing::TestWithParam<Kind> {
protected:
    Bar bar;
    std::unique_ptr<Engine> engine = make_engine(GetParam(), bar.rest);
    Matrix3Xd mass = lumped(bar.rest);
};
INSTANTIATE_TEST_SUITE_P(All, Dynamics, ::testing::Values(Kind::CpuFloat64, Kind::CpuFloat32, Kind::Gpu),
                         [](const auto& each) { return name_of(each.param); });

// ν = 0: u = A sin(π z/2L) cos(2π t/T), T = 4 L/√(E/ρ) = 0.23094011 s. A quarter, a half and a whole period.
TEST_P(Dynamics, FirstModeOfABarHasItsPeriod) {
    DynamicsState state = bar.first_mode(0.1);
    const double period = 0.23094011;
    for (const double expected : {0.0, -0.1, 0.0, 0.1}) {
        state = dynamics(*engine, bar.rest, mass, bar.conditions, state, period / 4, {.steps_per_check = 20}).state;
        EXPECT_NEAR(state.displacement(2, bar.tip()), expected, 0.004) << state.time;  // amplitude: finite strain, mesh
    }
    EXPECT_NEAR(state.time, period, 1e-12);
    EXPECT_NEAR(state.velocity(2, bar.tip()), 0.0, 0.03 * 0.1 * 2 * std::numbers::pi / period);
}

// A bar that bounces on another under its weight. A spring to one side alone takes energy out of a step of nine tenths
// of the critical one: the bar would jump higher than it came from, and the run be cut.
TEST_P(Dynamics, PairsThatMayPartGiveNoEnergyToWhatBounces) {
    Model model = bar.model;
    const meshing::TetMesh one = meshing::box_mesh({20, 20, 50}, {2, 2, 4});
    const int nodes = one.node_count();
    model.mesh.nodes.resize(3, 2 * nodes);
    model.mesh.nodes << one.nodes, one.nodes.colwise() + Vector3d(0, 0, 50);
    model.mesh.tets.resize(4, 2 * one.tet_count());
    model.mesh.tets << one.tets, (one.tets.array() + nodes).matrix();
    model.mesh.labels = Eigen::VectorXi::Ones(2 * one.tet_count());
    const RestState rest = rest_state(model);
    Conditions conditions;
    conditions.external_force = Matrix3Xd::Zero(3, rest.node_count);
    for (int node = 0; node < nodes; ++node) {
        if (one.nodes(2, node) == 0) conditions.prescribed.push_back({node, {true, true, true}, Vector3d::Zero()});
        if (one.nodes(2, node) < 50) continue;
        for (int other = nodes; other < 2 * nodes; ++other)
            if (model.mesh.nodes.col(other) == one.nodes.col(node))
                conditions.effects.parting.push_back({node, other, Vector3d::UnitZ(), 5000.0});
    }
    ASSERT_EQ(conditions.effects.parting.size(), 9u);
    conditions.external_force.row(2).tail(nodes) = -9810 * rest.lumped_mass.tail(nodes).transpose();
    const auto bars = make_engine(GetParam(), rest);
    DynamicsState start{Matrix3Xd::Zero(3, rest.node_count), Matrix3Xd::Zero(3, rest.node_count), 0};
    start.displacement.row(2).tail(nodes).array() += 0.2;
    int parted = 0, pressed = 0;
    const auto watch = [&](const DynamicsState& state, const EnergyBalance&) {
        const double g = overlap(conditions.effects.parting.front(), state.displacement);
        parted += g < -0.01;
        pressed += g > 0;
    };
    const DynamicsResult result = dynamics(*bars, rest, lumped(rest), nodal_conditions(conditions, rest), start, 0.15,
                                           {.steps_per_check = 25, .watch = watch});
    EXPECT_EQ(result.cuts, 0);
    EXPECT_LT(result.energy.largest_growth, 0.01);
    EXPECT_GT(parted, 3);
    EXPECT_GT(pressed, 3);
}

// Mass-proportional damping: u = A e^(−αt/2) cos(ω_d t) with ω_d² = ω² − α²/4.
TEST_P(Dynamics, DampedModeDecaysAsTheClosedForm) {
    const double omega = 2 * std::numbers::pi / 0.23094011, alpha = 10, time = 0.1;
    const auto result =
        dynamics(*engine, bar.rest, mass, bar.conditions, bar.first_mode(0.1), time, {.damping = alpha});
    const double damped = std::sqrt(omega * omega - alpha * alpha / 4);
    const double expected =
        0.1 * std::exp(-alpha * time / 2) * (std::cos(damped * time) + alpha / (2 * damped) * std::sin(damped * time));
    EXPECT_NEAR(result.state.displacement(2, bar.tip()), expected, 0.003);
}

TEST_P(Dynamics, EnergyIsConservedOverManySteps) {
    std::vector<double> totals;
    DynamicsOptions options{.steps_per_check = 500};
    options.watch = [&](const DynamicsState&, const EnergyBalance& energy) { totals.push_back(energy.total); };
    const auto result = dynamics(*engine, bar.rest, mass, bar.conditions, bar.first_mode(2.0), 20.0, options);
    EXPECT_EQ(result.cuts, 0);
    EXPECT_GT(result.steps, 5000);
    // 4e-4: what the third-order terms of the law exchange within a check.
    for (const double total : totals) EXPECT_NEAR(total, totals.front(), 1e-3 * totals.front());
}

// A rotating free body keeps linear and angular momentum.
TEST_P(Dynamics, AFreeBodyKeepsItsMomentum) {
    const NodalConditions free = nodal_conditions({}, bar.rest.node_count);
    DynamicsState state{Matrix3Xd::Zero(3, bar.rest.node_count), Matrix3Xd::Zero(3, bar.rest.node_count), 0};
    const Vector3d spin(0.5, 1.0, 2.0), drift(3, -2, 1);  // 1/s, mm/s
    for (int node = 0; node < bar.rest.node_count; ++node)
        state.velocity.col(node) = drift + spin.cross(Vector3d(bar.model.mesh.nodes.col(node)));
    const auto momentum = [&](const DynamicsState& s) {
        return Vector3d((mass.cwiseProduct(s.velocity)).rowwise().sum());
    };
    const auto angular = [&](const DynamicsState& s) {
        Vector3d sum = Vector3d::Zero();
        for (int node = 0; node < bar.rest.node_count; ++node)
            sum += mass(0, node) * Vector3d(bar.model.mesh.nodes.col(node) + s.displacement.col(node))
                                       .cross(Vector3d(s.velocity.col(node)));
        return sum;
    };
    const Vector3d before = momentum(state), turning = angular(state);
    const auto result = dynamics(*engine, bar.rest, mass, free, state, 1.0, {.steps_per_check = 100});
    EXPECT_GT(largest(result.state.displacement), 50) << "the body does not turn";
    EXPECT_LT((momentum(result.state) - before).norm(), 1e-5 * before.norm());
    EXPECT_LT((angular(result.state) - turning).norm(), 2e-4 * turning.norm());
}

TEST_P(Dynamics, AStepAboveTheCriticalOneIsRefused) {
    const double critical = dynamics(*engine, bar.rest, mass, bar.conditions, bar.first_mode(0.1), 0.01).critical_step;
    try {
        dynamics(*engine, bar.rest, mass, bar.conditions, bar.first_mode(0.1), 0.1, {.step = 1.01 * critical});
        FAIL() << "accepted";
    } catch (const InvalidInput& error) {
        EXPECT_THAT(error.what(), ::testing::HasSubstr("above the critical"));
    }
    EXPECT_NO_THROW(
        dynamics(*engine, bar.rest, mass, bar.conditions, bar.first_mode(0.1), 0.1, {.step = 0.9 * critical}));
}

// Pressed by a weight to three quarters of its length the bar stiffens, and so must the step fall.
TEST_P(Dynamics, TheStepIsCutWhenTissueStiffens) {
    NodalConditions conditions = bar.conditions;
    conditions.external_force.row(2) = -8000 * mass.row(2);  // mN for a weight of 8000 mm/s²
    const DynamicsState still{Matrix3Xd::Zero(3, bar.rest.node_count), Matrix3Xd::Zero(3, bar.rest.node_count), 0};
    const DynamicsOptions options{.damping = 5, .safety = 0.95, .steps_per_check = 5};
    const auto result = dynamics(*engine, bar.rest, mass, conditions, still, 0.12, options);
    EXPECT_GT(result.cuts, 0);
    EXPECT_LT(result.state.displacement(2, bar.tip()), -20);
    EXPECT_LT(result.min_jacobian, 0.8);
    EXPECT_LT(result.energy.largest_growth, 0.02);
}

// A blow that turns tissue inside out ends in a refusal that leaves the last good state.
TEST_P(Dynamics, ABlowThatInvertsTissueIsRefusedAndTheLastGoodStateIsLeft) {
    DynamicsState state = bar.first_mode(0.0);
    state.velocity(2, bar.tip()) = -1e6;  // mm/s
    try {
        dynamics(*engine, bar.rest, mass, bar.conditions, state, 0.1, {.steps_per_check = 10});
        FAIL() << "accepted";
    } catch (const SolverFailure& error) {
        EXPECT_THAT(error.what(), ::testing::HasSubstr("dynamics stopped"));
    }
    EXPECT_TRUE(engine->displacement().allFinite());
    EXPECT_GT(engine->observe().min_jacobian, 0.9);  // 1, at rest
}

// Power iteration against the dense eigenvalue of M⁻¹K.
// Holding the same conditions again and again must not be felt, by viscous stresses least of all: bit for bit.
TEST_P(Dynamics, ConditionsThatStayTheSameChangeNothing) {
    bar.model.viscosity[1] = {{{0.5, 0.05}}};
    bar.rest = rest_state(bar.model);
    engine = make_engine(GetParam(), bar.rest);
    const DynamicsOptions options{.steps_per_check = 50, .stops = {0.04, 0.1}};
    const auto once = dynamics(*engine, bar.rest, mass, bar.conditions, bar.first_mode(0.1), 0.1, options);
    int asked = 0;
    const auto always = [&](double) -> const NodalConditions& {
        ++asked;
        return bar.conditions;
    };
    const ChangingConditions changing{always, 15 * once.step};
    engine = make_engine(GetParam(), bar.rest);  // the first force of another would be read after a step's relaxation
    const auto again = dynamics(*engine, bar.rest, mass, changing, bar.first_mode(0.1), 0.1, options);
    EXPECT_EQ(again.state.displacement, once.state.displacement);
    EXPECT_EQ(again.steps, once.steps);
    EXPECT_GE(asked, once.steps / 15);
}

// The tip pulled out evenly and slowly: u = v t z/L but for a wave of the start, v z/c at most.
TEST_P(Dynamics, ATipThatIsPulledSlowlyTakesTheBarWithIt) {
    const double speed = 5, length = 100, wave_speed = std::sqrt(3.0 / 1e-6);
    NodalConditions now = bar.conditions;
    for (int node = 0; node < bar.rest.node_count; ++node)
        if (bar.rest.position(2, node) == length) now.constrained(2, node) = true;
    std::vector<double> times;
    const auto pulled = [&](double time) -> const NodalConditions& {
        for (int node = 0; node < bar.rest.node_count; ++node)
            if (bar.rest.position(2, node) == length) now.imposed(2, node) = speed * time;
        times.push_back(time);
        return now;
    };
    std::vector<double> seen;
    DynamicsOptions options{.damping = 20.0, .stops = {0.13, 0.2}};
    options.watch = [&](const DynamicsState& state, const EnergyBalance&) { seen.push_back(state.time); };
    const DynamicsState rest{Matrix3Xd::Zero(3, bar.rest.node_count), Matrix3Xd::Zero(3, bar.rest.node_count), 0};
    const auto result = dynamics(*engine, bar.rest, mass, ChangingConditions{pulled, 1e-3}, rest, 0.4, options);
    for (int node = 0; node < bar.rest.node_count; ++node)
        EXPECT_NEAR(result.state.displacement(2, node), speed * 0.4 * bar.rest.position(2, node) / length,
                    speed * length / wave_speed);
    EXPECT_NEAR(result.state.displacement(2, bar.tip()), 2.0, 1e-6) << "the tip is where it was last told to be";
    for (const double stop : options.stops)
        EXPECT_TRUE(std::any_of(seen.begin(), seen.end(), [&](double t) { return std::abs(t - stop) < 1e-9; })) << stop;
    for (std::size_t i = 1; i < times.size(); ++i)
        EXPECT_LT(times[i] - times[i - 1], 1e-3 + 11 * result.step) << "held no longer than told";
}

TEST_P(Dynamics, StopsOutOfOrderAreRefused) {
    EXPECT_THROW(dynamics(*engine, bar.rest, mass, bar.conditions, bar.first_mode(0.1), 0.1, {.stops = {0.1, 0.05}}),
                 InvalidInput);
}

TEST_P(Dynamics, HighestModeIsThatOfTheTangent) {
    const Bar small(3, 0.3);
    const auto small_engine = make_engine(GetParam(), small.rest);
    const Matrix3Xd m = lumped(small.rest), zero = Matrix3Xd::Zero(3, small.rest.node_count);
    const Eigen::MatrixXd K = tangent_stiffness(small.rest, zero);
    const Eigen::VectorXd scale = m.reshaped().cwiseSqrt().cwiseInverse();
    const double expected = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scale.asDiagonal() * K * scale.asDiagonal())
                                .eigenvalues()
                                .maxCoeff();
    const HighestMode mode = highest_mode(*small_engine, m, zero, 60);
    EXPECT_NEAR(mode.eigenvalue, expected, 0.02 * expected);
    EXPECT_LT(mode.eigenvalue, 1.002 * expected);
    // The element bound is safe.
    EXPECT_LT(element_step_bounds(small.rest, small.model.density).minCoeff(), 2 / std::sqrt(expected));
    EXPECT_GT(element_step_bounds(small.rest, small.model.density).minCoeff(), 0.25 * 2 / std::sqrt(expected));
}

// One sliver limits the step; scaled, the whole runs at the step of the others.
TEST_P(Dynamics, MassScalingRaisesTheCriticalStep) {
    Bar sliver(10, 0.3);
    const int inner = 4 + 9 * 5;  // on the axis
    sliver.model.mesh.nodes(2, inner) += 9;
    sliver.rest = rest_state(sliver.model);
    const auto slow = make_engine(GetParam(), sliver.rest);
    const Matrix3Xd zero = Matrix3Xd::Zero(3, sliver.rest.node_count);
    const auto critical = [&](const Matrix3Xd& m) {
        slow->set_mass(m);
        slow->set_conditions(sliver.conditions);
        return 2 / std::sqrt(highest_mode(*slow, m, zero, 60).eigenvalue);
    };
    const double before = critical(lumped(sliver.rest));
    const double target = 1.5 * before;
    const MassScaling scaling = scaled_mass(sliver.rest, 1e-6, target);
    EXPECT_LT(scaling.scaled_elements, sliver.rest.element_count());
    EXPECT_NEAR(scaling.added_fraction, 0.467, 0.047);
    EXPECT_GE(critical(scaling.mass), target);
}

TEST(MassScaling, AddsNothingWhereNoElementNeedsIt) {
    const Bar bar;
    const MassScaling scaling = scaled_mass(bar.rest, 1e-6, 0.5 * element_step_bounds(bar.rest, 1e-6).minCoeff());
    EXPECT_EQ(scaling.scaled_elements, 0);
    EXPECT_EQ(scaling.added_fraction, 0.0);
    EXPECT_EQ(scaling.mass, lumped(bar.rest));
}

}  // namespace
}  // namespace tissuewarp::tled
