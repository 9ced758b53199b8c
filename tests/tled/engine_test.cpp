/// Every engine against the float64 reference, the GPU engine on whatever device EGL offers.
#include "tests/tled/engine_scene.hpp"

#include <gmock/gmock.h>
#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <string>
#include <tuple>

namespace tissuewarp::tled {
namespace {

using namespace scene;

class Engines : public ::testing::TestWithParam<std::tuple<Kind, Element, Laws>> {
protected:
    Kind kind = std::get<0>(GetParam());
    Model model = cube(5, std::get<1>(GetParam()), std::get<2>(GetParam()));
    RestState rest = rest_state(model);
    const Matrix3Xd& X = model.mesh.nodes;
    std::unique_ptr<Engine> engine = make_engine(kind, rest);
    Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
};

INSTANTIATE_TEST_SUITE_P(
    All, Engines,
    ::testing::Combine(::testing::Values(Kind::CpuFloat64, Kind::CpuFloat32, Kind::Gpu, Kind::GpuPatches),
                       ::testing::Values(Element::T4, Element::AveragedPressureT4),
                       ::testing::Values(Laws::Iso, Laws::LnJ, Laws::Stable, Laws::Polynomial, Laws::ArrudaBoyce,
                                         Laws::Ogden, Laws::Fibres, Laws::TwoFibres, Laws::Mixed)),
    [](const auto& each) {
        return std::string(name_of(std::get<0>(each.param))) + name_of(std::get<1>(each.param)) +
               name_of(std::get<2>(each.param));
    });

TEST_P(Engines, InternalForceIsTheReferences) {
    for (const double amplitude : {1.0, 0.01}) {
        const Matrix3Xd u = wavy(X, amplitude).cast<float>().cast<double>();
        const Matrix3Xd expected = internal_force(rest, u);
        engine->set_state(u, zero);
        EXPECT_LT(largest(engine->internal_force() - expected), 1e-5 * largest(expected)) << amplitude;
    }
}

// Strains far below the last place of 1 keep their digits. A failure looks like: a force of another direction, because
// a law took the difference of 1 + strain and 1.
TEST_P(Engines, ForceOfTinyStrainsIsThatOfSmallOnesScaledDown) {
    const auto scaled = [&](int exponent) -> Matrix3Xd {
        engine->set_state(std::ldexp(1.0, exponent) * wavy(X), zero);
        return engine->internal_force() * std::ldexp(1.0, -exponent);
    };
    const Matrix3Xd linear = scaled(-20);
    const int tiny = kind == Kind::CpuFloat64 ? -70 : -40;
    EXPECT_LT(largest(scaled(tiny) - linear), 1e-5 * largest(linear));
}

TEST_P(Engines, ARigidRotationCausesNoForce) {
    const Matrix3d R = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    engine->set_state((R - Matrix3d::Identity()) * X, zero);
    const double scale = largest(internal_force(rest, wavy(X)));
    EXPECT_LT(largest(engine->internal_force()), 1e-3 * scale);
}

TEST_P(Engines, ResidualHasSpringsForcesAndConstraints) {
    const NodalConditions conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);
    engine->set_state(wavy(X), zero);
    engine->set_conditions(conditions);
    const Matrix3Xd u = conditions.constrained.select(conditions.imposed, wavy(X));
    EXPECT_LT(largest(engine->displacement() - u), 1e-6);
    const Matrix3Xd expected = plain_residual(rest, conditions, u);
    const Matrix3Xd residual = engine->residual();
    EXPECT_LT(largest(residual - expected), 1e-5 * largest(internal_force(rest, u)));
    EXPECT_TRUE((conditions.constrained.array() <= (residual.array() == 0)).all());
    // Reactions: the internal force is not masked.
    EXPECT_LT(largest(engine->internal_force() - internal_force(rest, u)), 1e-5 * largest(internal_force(rest, u)));
}

TEST_P(Engines, TwoHundredStepsFollowThePlainLoop) {
    const NodalConditions conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);
    const StepCoefficients coefficients = stable_coefficients(model, rest);
    engine->set_conditions(conditions);
    engine->set_state(wavy(X, 0.3), zero);
    engine->run(200, coefficients);
    const PlainState plain = plain_steps(rest, conditions, lumped(rest), wavy(X, 0.3), zero, 200, coefficients);
    // From the state after no step, which holds the imposed displacements already: the free nodes must travel.
    const PlainState start = plain_steps(rest, conditions, lumped(rest), wavy(X, 0.3), zero, 0, coefficients);
    EXPECT_GT(largest(plain.u - start.u), 1.0) << "the test does not move";
    EXPECT_LT(largest(engine->displacement() - plain.u), 5e-6 * largest(plain.u));
    EXPECT_LT(largest(engine->increment() - plain.v), 1e-4 * largest(plain.v));
}

TEST_P(Engines, ObservesWhatTheHostComputes) {
    const NodalConditions conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);
    const StepCoefficients coefficients = stable_coefficients(model, rest);
    const Matrix3Xd mass = 2.0 * lumped(rest) + Matrix3Xd::Constant(3, rest.node_count, 1e-6);
    engine->set_mass(mass);
    engine->set_conditions(conditions);
    engine->set_state(wavy(X, 0.3), zero);
    engine->run(20, coefficients);
    const PlainState plain = plain_steps(rest, conditions, mass, wavy(X, 0.3), zero, 20, coefficients);
    const Matrix3Xd residual = plain_residual(rest, conditions, plain.u);

    const Observation seen = engine->observe();
    EXPECT_TRUE(seen.finite);
    const double increment_max = std::sqrt(plain.v.colwise().squaredNorm().maxCoeff());
    EXPECT_NEAR(seen.increment_max, increment_max, 1e-4 * increment_max);
    const double residual_max = std::sqrt(residual.colwise().squaredNorm().maxCoeff());
    EXPECT_NEAR(seen.residual_max, residual_max, 1e-4 * residual_max);
    const double increment_mass = plain.v.cwiseAbs2().cwiseProduct(mass).sum();
    EXPECT_NEAR(seen.increment_mass, increment_mass, 1e-4 * increment_mass);
    const double increment_stiffness = plain.v.cwiseProduct(plain.previous_residual - residual).sum();
    EXPECT_NEAR(seen.increment_stiffness, increment_stiffness, 1e-3 * std::abs(increment_stiffness));
    Eigen::Index element = -1;
    const double least = jacobians(rest, plain.u).minCoeff(&element);
    EXPECT_NEAR(seen.min_jacobian, least, 1e-5);
    EXPECT_EQ(seen.min_jacobian_tet, static_cast<int>(element));
}

TEST_P(Engines, RepeatsBitByBit) {
    const NodalConditions conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);
    const StepCoefficients coefficients = stable_coefficients(model, rest);
    const auto run = [&](Engine& each) {
        each.set_conditions(conditions);
        each.set_state(wavy(X, 0.3), zero);
        each.run(100, coefficients);
        return std::tuple{each.displacement(), each.increment(), each.observe().increment_stiffness};
    };
    const auto first = run(*engine);
    EXPECT_EQ(run(*engine), first);
    EXPECT_EQ(run(*make_engine(kind, rest)), first);
}

// Two materials with one and three terms, so that terms cannot be mixed up.
TEST_P(Engines, ViscousStepsFollowThePlainLoop) {
    model.viscosity[1] = {{{0.3, 0.01}}};
    model.viscosity[2] = {{{0.2, 0.002}, {0.1, 0.02}, {0.3, 0.2}}};
    rest = rest_state(model);
    engine = make_engine(kind, rest);
    const NodalConditions conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);
    StepCoefficients coefficients = stable_coefficients(model, rest);
    coefficients.time_step = 0.0005;
    engine->set_conditions(conditions);
    engine->set_state(wavy(X, 0.3), zero);
    engine->run(60, coefficients);
    engine->residual();  // looking does not move time
    engine->run(40, coefficients);
    PlainStresses stresses(rest);
    const PlainState plain =
        plain_steps(rest, conditions, lumped(rest), wavy(X, 0.3), zero, 100, coefficients, &stresses);
    EXPECT_LT(largest(engine->displacement() - plain.u), 5e-6 * largest(plain.u));
    const PlainState elastic = plain_steps(rest, conditions, lumped(rest), wavy(X, 0.3), zero, 100, coefficients);
    EXPECT_GT(largest(elastic.u - plain.u), 1e-3) << "viscosity does not matter here";
    const Matrix3Xd expected = stresses.force(rest, plain.u);
    EXPECT_LT(largest(engine->internal_force() - expected), 2e-5 * largest(expected));
    engine->set_conditions(nodal_conditions({}, rest.node_count));
    engine->set_state(wavy(X), zero);  // forgets
    const Matrix3Xd fresh = internal_force(rest, wavy(X));
    EXPECT_LT(largest(engine->internal_force() - fresh), 1e-5 * largest(fresh));
}

// Twenty steps for each of the stresses. A failure looks like: stresses that move with every step, or at another one
// than the plain loop's; the sum of other terms.
TEST_P(Engines, ViscousStressesRestBetweenTheirOwnSteps) {
    model.viscosity[1] = {{{0.5, 0.32}}};
    model.viscosity[2] = {{{0.2, 0.4}, {0.3, 0.5}, {0.2, 0.32}}};
    rest = rest_state(model);
    engine = make_engine(kind, rest);
    const NodalConditions conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);
    StepCoefficients coefficients = stable_coefficients(model, rest);
    coefficients.time_step = 0.0005;
    engine->set_conditions(conditions);
    engine->set_state(wavy(X, 0.3), zero);
    engine->run(47, coefficients);
    engine->residual();  // in the midst of a rest
    engine->run(66, coefficients);
    PlainStresses stresses(rest);
    const PlainState plain =
        plain_steps(rest, conditions, lumped(rest), wavy(X, 0.3), zero, 113, coefficients, &stresses);
    const double tolerance = kind == Kind::GpuPatches ? 5e-5 : 5e-6;  // patches let them rest in half precision
    EXPECT_LT(largest(engine->displacement() - plain.u), tolerance * largest(plain.u));
    const Matrix3Xd expected = stresses.force(rest, plain.u);
    EXPECT_LT(largest(engine->internal_force() - expected), 4 * tolerance * largest(expected));
    const Matrix3Xd as_they_rest = plain_residual(rest, conditions, plain.u, &stresses.stresses);
    EXPECT_LT(largest(engine->residual() - as_they_rest), 4 * tolerance * largest(expected));
    EXPECT_GT(largest(as_they_rest - plain_residual(rest, conditions, plain.u)), 1e-3 * largest(expected));
    EXPECT_EQ(stresses.clock.next(1, coefficients.time_step).front().interval, 0) << "113 = 5 · 20 + 13";
}

TEST_P(Engines, RunningInPortionsIsRunningAtOnce) {
    const StepCoefficients coefficients = stable_coefficients(model, rest);
    engine->set_state(wavy(X, 0.3), zero);
    engine->run(30, coefficients);
    const Matrix3Xd at_once = engine->displacement();
    engine->set_state(wavy(X, 0.3), zero);
    for (const int steps : {1, 12, 0, 17}) {
        engine->run(steps, coefficients);
        engine->observe();
        engine->internal_force();
    }
    EXPECT_EQ(engine->displacement(), at_once);
}

TEST_P(Engines, ToRunAndCheckIsToRunAndThenToLook) {
    const StepCoefficients first = stable_coefficients(model, rest), then{0.5 * first.momentum, first.gain, 0};
    engine->set_state(wavy(X, 0.3), zero);
    engine->run(30, first);
    engine->run(12, then);
    const Matrix3Xd displacement = engine->displacement();
    const SmallestJacobian smallest = engine->smallest_jacobian();
    engine->set_state(wavy(X, 0.3), zero);
    for (const CheckedDisplacement& found :
         {engine->run_and_check(std::array{Steps{30, first}, Steps{0, first}, Steps{12, then}}),
          engine->run_and_check({})}) {
        EXPECT_EQ(found.value, displacement);
        EXPECT_EQ(found.smallest.value, smallest.value);
        EXPECT_EQ(found.smallest.tet, smallest.tet);
    }
}

}  // namespace
}  // namespace tissuewarp::tled
