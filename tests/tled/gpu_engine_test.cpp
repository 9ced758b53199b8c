/// The GPU engine against the float64 reference, on whatever device EGL offers.
#include "core/errors.hpp"
#include "meshing/primitives.hpp"
#include "shaders/device.hpp"
#include "tled/engine.hpp"
#include "tled/reference.hpp"

#include <gmock/gmock.h>
#include <Eigen/Geometry>

#include <cmath>
#include <limits>
#include <string>
#include <thread>
#include <tuple>

namespace tissuewarp::tled {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

enum class Laws { Iso, LnJ, Mixed };

/// A jittered cube of 30 mm, label 1 in front and 2 behind a diagonal plane, so that blocks and pressure nodes mix.
Model cube(int cells, Element element, Laws laws) {
    Model model;
    model.mesh = meshing::box_mesh({30, 30, 30}, {cells, cells, cells}, 0.1, 3);
    for (int t = 0; t < model.mesh.tet_count(); ++t) {
        Vector3d sum = Vector3d::Zero();
        for (const int node : model.mesh.tets.col(t)) sum += model.mesh.nodes.col(node);
        model.mesh.labels[t] = sum.x() + sum.y() < 110 ? 1 : 2;
    }
    const NeoHookeanIso soft_iso{1.007, 50.0};
    const NeoHookeanLnJ soft_lnj{1.007, 49.329};
    model.materials[1] = laws == Laws::Iso ? Material(soft_iso) : Material(soft_lnj);
    model.materials[2] = laws == Laws::LnJ ? Material(NeoHookeanLnJ{3.0, 20.0}) : Material(NeoHookeanIso{2.5, 30.0});
    model.element = element;
    return model;
}

/// Smooth, with strains of about 10 %; mm.
Matrix3Xd wavy(const Matrix3Xd& X, double amplitude = 1.0) {
    Matrix3Xd u(3, X.cols());
    for (Eigen::Index i = 0; i < X.cols(); ++i)
        u.col(i) = amplitude * Vector3d(std::sin(0.11 * X(1, i) + 0.05 * X(2, i)), 0.8 * std::cos(0.13 * X(0, i)),
                                        0.7 * std::sin(0.1 * X(0, i) - 0.08 * X(2, i)));
    return u;
}

/// The bottom held, the top's x and z imposed, springs on two sides of which one node has two, a body force.
Conditions mixed_conditions(const meshing::TetMesh& mesh) {
    Conditions conditions;
    conditions.external_force = Matrix3Xd::Zero(3, mesh.node_count());
    Matrix3d stiffness;
    stiffness << 5, 1, 0.5, 1, 4, -0.3, 0.5, -0.3, 3;
    for (int node = 0; node < mesh.node_count(); ++node) {
        const Vector3d X = mesh.nodes.col(node);
        conditions.external_force.col(node) = Vector3d(0.02, -0.3, 0.1 * X.x() / 30);
        if (X.z() < 1e-9)
            conditions.prescribed.push_back({node, {true, true, true}, {0, 0, 0}});
        else if (X.z() > 30 - 1e-9)
            conditions.prescribed.push_back({node, {true, false, true}, {0.6, 0, -1.5}});
        else if (X.x() < 1e-9)
            conditions.springs.push_back({node, stiffness, {0.4, -0.2, 0.3}});
    }
    conditions.springs.push_back({conditions.springs.front().node, Matrix3d::Identity(), {1, 1, 1}});
    return conditions;
}

/// c well inside the stability bound c ω² < 4 by ω² ≤ 4 (λ + 2μ)/ρ Σ |grad N|² of an element.
StepCoefficients stable_coefficients(const Model& model, const RestState& rest) {
    double omega_squared = 0;
    for (int e = 0; e < rest.element_count(); ++e) {
        const auto gradient = rest.gradient.col(e).reshaped(3, 3);
        const double sum = gradient.squaredNorm() + gradient.rowwise().sum().squaredNorm();
        const Material& material = model.materials.at(model.mesh.labels[rest.tet[static_cast<std::size_t>(e)]]);
        omega_squared = std::max(omega_squared, 4 * p_wave_modulus(material) / model.density * sum);
    }
    return {0.98, 2 / omega_squared};
}

/// The residual of the interface's comment in plain float64.
Matrix3Xd plain_residual(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& u) {
    Matrix3Xd residual = conditions.external_force - internal_force(rest, u);
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s) {
        const auto column = static_cast<Eigen::Index>(s);
        const auto k = conditions.spring_stiffness.col(column);
        Matrix3d K;
        K << k[0], k[3], k[5], k[3], k[1], k[4], k[5], k[4], k[2];
        const int node = conditions.spring_node[s];
        residual.col(node) += conditions.spring_force.col(column) - K * u.col(node);
    }
    return conditions.constrained.select(Matrix3Xd::Zero(3, rest.node_count), residual);
}

struct PlainState {
    Matrix3Xd u, v, previous_residual;
};

/// The update of the interface's comment in plain float64.
PlainState plain_steps(const RestState& rest, const NodalConditions& conditions, const Matrix3Xd& mass, Matrix3Xd u,
                       Matrix3Xd v, int steps, const StepCoefficients& coefficients) {
    const Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    u = conditions.constrained.select(conditions.imposed, u).eval();
    v = conditions.constrained.select(zero, v).eval();
    PlainState state{u, v, zero};
    for (int step = 0; step < steps; ++step) {
        state.previous_residual = plain_residual(rest, conditions, state.u);
        state.v =
            coefficients.momentum * state.v + coefficients.gain * state.previous_residual.cwiseQuotient(mass).eval();
        state.u += state.v;
    }
    return state;
}

double largest(const Matrix3Xd& vectors) {
    return vectors.cwiseAbs().maxCoeff();
}

Matrix3Xd lumped(const RestState& rest) {
    return rest.lumped_mass.transpose().replicate(3, 1);
}

class GpuEngines : public ::testing::TestWithParam<std::tuple<Element, Laws>> {
protected:
    Model model = cube(5, std::get<0>(GetParam()), std::get<1>(GetParam()));
    RestState rest = rest_state(model);
    const Matrix3Xd& X = model.mesh.nodes;
    std::unique_ptr<Engine> engine = make_gpu_engine(rest);
    Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
};

INSTANTIATE_TEST_SUITE_P(All, GpuEngines,
                         ::testing::Combine(::testing::Values(Element::T4, Element::AveragedPressureT4),
                                            ::testing::Values(Laws::Iso, Laws::LnJ, Laws::Mixed)),
                         [](const auto& each) {
                             const std::string element =
                                 std::get<0>(each.param) == Element::T4 ? "T4" : "AveragedPressure";
                             const Laws laws = std::get<1>(each.param);
                             return element + (laws == Laws::Iso ? "Iso" : laws == Laws::LnJ ? "LnJ" : "Mixed");
                         });

TEST_P(GpuEngines, InternalForceIsTheReferences) {
    for (const double amplitude : {1.0, 0.01}) {
        const Matrix3Xd u = wavy(X, amplitude).cast<float>().cast<double>();
        const Matrix3Xd expected = internal_force(rest, u);
        engine->set_state(u, zero);
        EXPECT_LT(largest(engine->internal_force() - expected), 1e-5 * largest(expected)) << amplitude;
    }
}

TEST_P(GpuEngines, ARigidRotationCausesNoForce) {
    const Matrix3d R = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    engine->set_state((R - Matrix3d::Identity()) * X, zero);
    const double scale = largest(internal_force(rest, wavy(X)));
    EXPECT_LT(largest(engine->internal_force()), 1e-3 * scale);
}

TEST_P(GpuEngines, ResidualHasSpringsForcesAndConstraints) {
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

TEST_P(GpuEngines, TwoHundredStepsFollowThePlainLoop) {
    const NodalConditions conditions = nodal_conditions(mixed_conditions(model.mesh), rest.node_count);
    const StepCoefficients coefficients = stable_coefficients(model, rest);
    engine->set_conditions(conditions);
    engine->set_state(wavy(X, 0.3), zero);
    engine->run(200, coefficients);
    const PlainState plain = plain_steps(rest, conditions, lumped(rest), wavy(X, 0.3), zero, 200, coefficients);
    EXPECT_GT(largest(plain.u - wavy(X, 0.3)), 0.3) << "the test does not move";
    EXPECT_LT(largest(engine->displacement() - plain.u), 5e-6 * largest(plain.u));
    EXPECT_LT(largest(engine->increment() - plain.v), 1e-4 * largest(plain.v));
}

TEST_P(GpuEngines, ObservesWhatTheHostComputes) {
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
    Eigen::Index tet = -1;
    const double least = jacobians(rest, plain.u).minCoeff(&tet);
    EXPECT_NEAR(seen.min_jacobian, least, 1e-5);
    EXPECT_EQ(seen.min_jacobian_tet, static_cast<int>(tet));
}

TEST_P(GpuEngines, RepeatsBitByBit) {
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
    EXPECT_EQ(run(*make_gpu_engine(rest)), first);
}

TEST_P(GpuEngines, RunningInPortionsIsRunningAtOnce) {
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

class GpuEngine : public ::testing::Test {
protected:
    Model model = cube(4, Element::AveragedPressureT4, Laws::Mixed);
    RestState rest = rest_state(model);
    const Matrix3Xd& X = model.mesh.nodes;
    Matrix3Xd zero = Matrix3Xd::Zero(3, rest.node_count);
    NodalConditions free = nodal_conditions({}, rest.node_count);
};

TEST_F(GpuEngine, StaysAtRestWithoutLoads) {
    const auto engine = make_gpu_engine(rest);
    engine->run(10, stable_coefficients(model, rest));
    EXPECT_EQ(engine->displacement(), zero);
    const Observation seen = engine->observe();
    EXPECT_TRUE(seen.finite);
    EXPECT_EQ(seen.min_jacobian, 1.0);
    EXPECT_EQ(seen.residual_max, 0.0);
}

TEST_F(GpuEngine, ObservesTheIncrementThatWasSet) {
    const auto engine = make_gpu_engine(rest);
    const Matrix3Xd u = wavy(X), v = wavy(X, 0.01);
    engine->set_conditions(free);
    engine->set_state(u, v);
    const Observation seen = engine->observe();
    const Matrix3Xd change = internal_force(rest, u) - internal_force(rest, u - v);
    const double expected = v.cwiseProduct(change).sum();
    EXPECT_NEAR(seen.increment_stiffness, expected, 1e-3 * std::abs(expected));
    EXPECT_NEAR(seen.increment_max, std::sqrt(v.colwise().squaredNorm().maxCoeff()), 1e-6);
}

TEST_F(GpuEngine, ConditionsReplaceEarlierOnes) {
    const auto engine = make_gpu_engine(rest);
    engine->set_conditions(nodal_conditions(mixed_conditions(model.mesh), rest.node_count));
    engine->run(5, stable_coefficients(model, rest));
    engine->set_conditions(free);
    engine->set_state(wavy(X), zero);
    const Matrix3Xd expected = -internal_force(rest, wavy(X));
    EXPECT_LT(largest(engine->residual() - expected), 1e-5 * largest(expected));
}

TEST_F(GpuEngine, ImposedDisplacementsTakeEffectAtOnceAndStay) {
    const auto engine = make_gpu_engine(rest);
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

TEST_F(GpuEngine, NoticesWhatIsNotFinite) {
    const auto engine = make_gpu_engine(rest);
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

TEST_F(GpuEngine, NoticesAnInvertedElementAndThatItsForceIsNotFinite) {
    const auto engine = make_gpu_engine(rest);
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

TEST_F(GpuEngine, DivergenceIsNoticed) {
    const auto engine = make_gpu_engine(rest);
    engine->set_state(wavy(X, 0.3), zero);
    StepCoefficients coefficients = stable_coefficients(model, rest);
    coefficients.gain *= 100;
    engine->run(300, coefficients);
    EXPECT_FALSE(engine->observe().finite);
}

TEST_F(GpuEngine, SeveralLiveSideBySide) {
    const RestState other_rest = rest_state(cube(3, Element::T4, Laws::LnJ));
    const auto first = make_gpu_engine(rest);
    const auto second = make_gpu_engine(other_rest);
    const StepCoefficients coefficients = stable_coefficients(model, rest);
    const Matrix3Xd start = wavy(X, 0.3);
    first->set_state(start, zero);
    second->set_state(Matrix3Xd::Constant(3, other_rest.node_count, 0.5), Matrix3Xd::Zero(3, other_rest.node_count));
    first->run(5, coefficients);
    second->run(5, coefficients);
    first->run(5, coefficients);
    const auto alone = make_gpu_engine(rest);
    alone->set_state(start, zero);
    alone->run(10, coefficients);
    EXPECT_EQ(first->displacement(), alone->displacement());
    EXPECT_LT(largest(second->displacement() - Matrix3Xd::Constant(3, other_rest.node_count, 0.5)), 1e-6);
}

TEST_F(GpuEngine, MayBeUsedFromOneThreadAfterAnother) {
    const auto engine = make_gpu_engine(rest);
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

TEST_F(GpuEngine, RefusesWrongShapesAndMasses) {
    const auto engine = make_gpu_engine(rest);
    const Matrix3Xd other = Matrix3Xd::Zero(3, rest.node_count + 1);
    EXPECT_THROW(engine->set_state(other, zero), InvalidInput);
    EXPECT_THROW(engine->set_state(zero, other), InvalidInput);
    EXPECT_THROW(engine->set_mass(Matrix3Xd::Ones(3, 1)), InvalidInput);
    EXPECT_THROW(engine->set_mass(zero), InvalidInput);
    EXPECT_THROW(engine->set_conditions(nodal_conditions({}, rest.node_count + 1)), InvalidInput);
}

TEST_F(GpuEngine, SaysWhereItRuns) {
    const auto engine = make_gpu_engine(rest);
    EXPECT_EQ(engine->description(), "GPU " + shaders::Device().renderer() + " (OpenGL 4.5)");
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
