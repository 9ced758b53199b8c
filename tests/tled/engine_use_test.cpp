/// How engines behave in use: conditions that change, trouble, several engines, threads.
#include "core/errors.hpp"
#include "shaders/device.hpp"
#include "tests/tled/engine_scene.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <string>
#include <thread>

namespace tissuewarp::tled {
namespace {

using namespace scene;

class EngineInUse : public ::testing::TestWithParam<Kind> {
protected:
    Model model = cube(4, Element::AveragedPressureT4, Laws::Mixed);
    RestState rest = rest_state(model);
    const Matrix3Xd& X = model.mesh.nodes;
    Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    NodalConditions free = nodal_conditions({}, rest.node_count);
};

INSTANTIATE_TEST_SUITE_P(All, EngineInUse, ::testing::Values(Kind::CpuFloat64, Kind::CpuFloat32, Kind::Gpu),
                         [](const auto& each) { return name_of(each.param); });

TEST_P(EngineInUse, StaysAtRestWithoutLoads) {
    const auto engine = make_engine(GetParam(), rest);
    engine->run(10, stable_coefficients(model, rest));
    EXPECT_EQ(engine->displacement(), zero);
    const Observation seen = engine->observe();
    EXPECT_TRUE(seen.finite);
    EXPECT_EQ(seen.min_jacobian, 1.0);
    EXPECT_EQ(seen.residual_max, 0.0);
}

TEST_P(EngineInUse, ReturnsToTheKeptStateBitByBit) {
    model.viscosity[1] = {{{0.3, 0.01}, {0.2, 0.002}}};
    const RestState viscous = rest_state(model);
    const auto engine = make_engine(GetParam(), viscous);
    StepCoefficients coefficients = stable_coefficients(model, viscous);
    coefficients.time_step = 0.0005;
    engine->set_state(wavy(X, 0.3), zero);
    engine->run(20, coefficients);
    engine->keep_state();
    engine->run(30, coefficients);
    const Matrix3Xd u = engine->displacement(), v = engine->increment();
    engine->set_state(wavy(X), wavy(X, 0.01));
    engine->return_to_kept_state();
    engine->run(30, coefficients);
    EXPECT_EQ(engine->displacement(), u);
    EXPECT_EQ(engine->increment(), v);
}

TEST_P(EngineInUse, TheIncrementMayBeReplacedAlone) {
    const auto engine = make_engine(GetParam(), rest);
    engine->set_conditions(nodal_conditions(mixed_conditions(model.mesh), rest.node_count));
    engine->set_state(wavy(X, 0.3), zero);
    const Matrix3Xd u = engine->displacement();
    engine->set_increment(wavy(X, 0.01));
    EXPECT_EQ(engine->displacement(), u);
    const auto held = nodal_conditions(mixed_conditions(model.mesh), rest.node_count).constrained;
    EXPECT_LT(largest(engine->increment() - held.select(zero, wavy(X, 0.01))), 1e-8);
}

TEST_P(EngineInUse, ObservesTheIncrementThatWasSet) {
    const auto engine = make_engine(GetParam(), rest);
    const Matrix3Xd u = wavy(X), v = wavy(X, 0.01);
    engine->set_conditions(free);
    engine->set_state(u, v);
    const Observation seen = engine->observe();
    const Matrix3Xd change = internal_force(rest, u) - internal_force(rest, u - v);
    const double expected = v.cwiseProduct(change).sum();
    EXPECT_NEAR(seen.increment_stiffness, expected, 1e-3 * std::abs(expected));
    EXPECT_NEAR(seen.increment_max, std::sqrt(v.colwise().squaredNorm().maxCoeff()), 1e-6);
}

TEST_P(EngineInUse, ConditionsReplaceEarlierOnes) {
    const auto engine = make_engine(GetParam(), rest);
    engine->set_conditions(nodal_conditions(mixed_conditions(model.mesh), rest.node_count));
    engine->run(5, stable_coefficients(model, rest));
    engine->set_conditions(free);
    engine->set_state(wavy(X), zero);
    const Matrix3Xd expected = -internal_force(rest, wavy(X));
    EXPECT_LT(largest(engine->residual() - expected), 1e-5 * largest(expected));
}

TEST_P(EngineInUse, ImposedDisplacementsTakeEffectAtOnceAndStay) {
    const auto engine = make_engine(GetParam(), rest);
    engine->set_state(wavy(X), wavy(X, 0.1));
    Conditions conditions;
    conditions.prescribed.push_back({7, {true, false, true}, {0.25, 9, -0.5}});
    engine->set_conditions(nodal_conditions(conditions, rest.node_count));
    const Matrix3Xd u = engine->displacement(), v = engine->increment();
    EXPECT_EQ(u(0, 7), 0.25);
    EXPECT_EQ(u(2, 7), -0.5);
    EXPECT_NEAR(u(1, 7), wavy(X)(1, 7), 1e-6);
    EXPECT_EQ(v(0, 7), 0.0);
    EXPECT_NE(v(1, 7), 0.0);
    engine->run(3, stable_coefficients(model, rest));
    EXPECT_EQ(engine->displacement()(0, 7), 0.25);
    EXPECT_EQ(engine->displacement()(2, 7), -0.5);
    EXPECT_NE(engine->displacement()(1, 7), u(1, 7));
}

TEST_P(EngineInUse, NoticesWhatIsNotFinite) {
    const auto engine = make_engine(GetParam(), rest);
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        Matrix3Xd u = zero;
        u(1, 40) = bad;
        engine->set_state(u, zero);
        const Observation seen = engine->observe();
        EXPECT_FALSE(seen.finite);
        EXPECT_FALSE(std::isfinite(seen.residual_max));
    }
    engine->set_state(zero, zero);
    EXPECT_TRUE(engine->observe().finite);
}

TEST_P(EngineInUse, NoticesAnInvertedElementAndThatItsForceIsNotFinite) {
    const auto engine = make_engine(GetParam(), rest);
    const int inside = 2 + 5 * (2 + 5 * 2);
    Matrix3Xd u = zero;
    u(0, inside) = 12.0;  // further than the neighbours of a node in cells of 7.5 mm
    engine->set_state(u, zero);
    const Observation seen = engine->observe();
    Eigen::Index tet = -1;
    const double least = jacobians(rest, u).minCoeff(&tet);
    ASSERT_LT(least, 0);
    EXPECT_NEAR(seen.min_jacobian, least, 1e-5);
    EXPECT_EQ(seen.min_jacobian_tet, static_cast<int>(tet));
    EXPECT_FALSE(seen.finite);
}

TEST_P(EngineInUse, DivergenceIsNoticed) {
    const auto engine = make_engine(GetParam(), rest);
    engine->set_state(wavy(X, 0.3), zero);
    StepCoefficients coefficients = stable_coefficients(model, rest);
    coefficients.gain *= 100;
    engine->run(300, coefficients);
    EXPECT_FALSE(engine->observe().finite);
}

TEST_P(EngineInUse, SeveralLiveSideBySide) {
    const RestState other_rest = rest_state(cube(3, Element::T4, Laws::LnJ));
    const auto first = make_engine(GetParam(), rest);
    const auto second = make_engine(GetParam(), other_rest);
    const StepCoefficients coefficients = stable_coefficients(model, rest);
    const Matrix3Xd start = wavy(X, 0.3);
    first->set_state(start, zero);
    second->set_state(Matrix3Xd::Constant(3, other_rest.node_count, 0.5), Matrix3Xd::Zero(3, other_rest.node_count));
    first->run(5, coefficients);
    second->run(5, coefficients);
    first->run(5, coefficients);
    const auto alone = make_engine(GetParam(), rest);
    alone->set_state(start, zero);
    alone->run(10, coefficients);
    EXPECT_EQ(first->displacement(), alone->displacement());
    EXPECT_LT(largest(second->displacement() - Matrix3Xd::Constant(3, other_rest.node_count, 0.5)), 1e-6);
}

TEST_P(EngineInUse, MayBeUsedFromOneThreadAfterAnother) {
    const auto engine = make_engine(GetParam(), rest);
    const StepCoefficients coefficients = stable_coefficients(model, rest);
    engine->set_state(wavy(X, 0.3), zero);
    engine->run(10, coefficients);
    const Matrix3Xd expected = engine->displacement();
    Matrix3Xd found;
    std::thread([&] {
        engine->set_state(wavy(X, 0.3), zero);
        engine->run(10, coefficients);
        found = engine->displacement();
    }).join();
    EXPECT_EQ(found, expected);
    EXPECT_EQ(engine->displacement(), expected);
}

TEST_P(EngineInUse, RefusesWrongShapesAndMasses) {
    const auto engine = make_engine(GetParam(), rest);
    const Matrix3Xd other = Matrix3Xd::Zero(3, rest.node_count + 1);
    EXPECT_THROW(engine->set_state(other, zero), InvalidInput);
    EXPECT_THROW(engine->set_state(zero, other), InvalidInput);
    EXPECT_THROW(engine->set_mass(Matrix3Xd::Ones(3, 1)), InvalidInput);
    EXPECT_THROW(engine->set_mass(zero), InvalidInput);
    EXPECT_THROW(engine->set_conditions(nodal_conditions({}, rest.node_count + 1)), InvalidInput);
}

class GpuEngine : public ::testing::Test {
protected:
    RestState rest = rest_state(cube(4, Element::AveragedPressureT4, Laws::Mixed));
};

TEST_F(GpuEngine, SaysWhereItRuns) {
    const auto engine = make_gpu_engine(rest);
    const std::string device = "GPU " + shaders::Device().renderer() + " (OpenGL 4.5)";
    EXPECT_THAT(engine->description(), ::testing::StartsWith(device + ", "));
    EXPECT_EQ(make_gpu_engine(rest, -1, {})->description(), device + ", two passes");
    EXPECT_EQ(engine->precision(), std::ldexp(1.0, -23));
}

TEST_F(GpuEngine, RefusesADeviceThatDoesNotExist) {
    EXPECT_THROW(make_gpu_engine(rest, 1000), GpuUnavailable);
}

TEST_F(GpuEngine, AMeshBeyondTheDeviceIsRefusedInWords) {
    // Corner forces take 64 bytes an element; the rest state need not be real to be too large.
    RestState huge = rest;
    const std::size_t limit = shaders::Device().limits().storage_buffer_bytes;
    if (limit > (std::size_t{1} << 28U)) GTEST_SKIP() << "the device holds more than this test wants to allocate";
    huge.tet.resize(limit / 64 + 1);
    try {
        make_gpu_engine(huge);
        FAIL() << "accepted";
    } catch (const GpuUnavailable& error) {
        EXPECT_THAT(error.what(), ::testing::HasSubstr("corner forces"));
        EXPECT_THAT(error.what(), ::testing::HasSubstr("CPU engine"));
    }
}

}  // namespace
}  // namespace tissuewarp::tled
