// A million steps, numbers too small for float32, and steps that are too long.

#include "core/errors.hpp"
#include "tests/stability/hard_cases.hpp"
#include "tled/critical_step.hpp"
#include "tled/dynamics.hpp"

#include <ctime>

namespace tissuewarp::stability {
namespace {

using LongRun = OnEveryEngine;
INSTANTIATE_TEST_SUITE_P(All, LongRun, every_engine, engine_name);

/// Steps of the drift case: the software rasteriser takes a minute for a hundred thousand, a sanitizer for ten
/// thousand.
int many_steps(Kind kind, const tled::Engine& engine) {
    if (sanitized) return 10000;
    const bool software = kind == Kind::Gpu && engine.description().find("llvmpipe") != std::string::npos;
    return software ? 100000 : 1000000;
}

// A free body that turns, drifts and swings. A failure looks like: energy or momentum that creeps (the recurrence in
// positions loses digits of float32 with every step), or a body that heats up. Energy 1e-3, momentum 1e-3 over all
// steps.
TEST_P(LongRun, AMillionStepsDriftNeitherInEnergyNorInMomentum) {
    const tled::Model model = box({20, 20, 20}, {2, 2, 2}, tled::neo_hookean_lnj(3.0, 0.3), tled::Element::T4);
    const tled::RestState rest = tled::rest_state(model);
    const auto engine = make_engine(GetParam(), rest);
    const Matrix3Xd mass = rest.lumped_mass.transpose().replicate(3, 1);
    tled::DynamicsState state{Matrix3Xd::Zero(3, rest.node_count), Matrix3Xd::Zero(3, rest.node_count), 0};
    const Vector3d centre = Vector3d::Constant(10), spin(1, 2, 3);  // 1/s
    for (int node = 0; node < rest.node_count; ++node) {
        const Vector3d arm = model.mesh.nodes.col(node) - centre;
        state.velocity.col(node) = spin.cross(arm) + Vector3d(0.02, -0.01, 0.03) + 2.0 * arm.x() * Vector3d::UnitX();
    }
    const tled::NodalConditions free = tled::nodal_conditions({}, rest.node_count);
    const double step = 0.7 * 2 / std::sqrt(tled::highest_mode(*engine, mass, state.displacement, 60).eigenvalue);
    std::vector<double> totals;
    const int steps = many_steps(GetParam(), *engine);
    tled::DynamicsOptions options{.step = step, .steps_per_check = steps / 200, .energy_tolerance = 0.05};
    options.watch = [&](const tled::DynamicsState&, const tled::EnergyBalance& energy) {
        totals.push_back(energy.total);
    };
    const auto linear = [&](const tled::DynamicsState& s) {
        return Vector3d(mass.cwiseProduct(s.velocity).rowwise().sum());
    };
    const auto angular = [&](const tled::DynamicsState& s) {
        Vector3d sum = Vector3d::Zero();
        for (int node = 0; node < rest.node_count; ++node)
            sum +=
                mass(0, node) *
                Vector3d(model.mesh.nodes.col(node) + s.displacement.col(node)).cross(Vector3d(s.velocity.col(node)));
        return sum;
    };
    const Vector3d before = linear(state), turning = angular(state);
    const auto result = tled::dynamics(*engine, rest, mass, free, state, steps * step, options);
    EXPECT_EQ(result.cuts, 0);
    EXPECT_GE(result.steps, steps - 1);
    const auto [least, most] = std::minmax_element(totals.begin(), totals.end());
    EXPECT_LT(*most - *least, 0.02 * totals.front()) << "spread";
    // Drift: the mean of the last tenth against that of the first.
    const auto mean = [&](std::size_t from, std::size_t to) {
        double sum = 0;
        for (std::size_t i = from; i < to; ++i) sum += totals[i];
        return sum / static_cast<double>(to - from);
    };
    const std::size_t tenth = std::max<std::size_t>(1, totals.size() / 10);
    // A tenth of a shorter run (software rasteriser, sanitizers) is no longer than a slow swing of the body.
    const double drift = mean(totals.size() - tenth, totals.size()) / mean(0, tenth) - 1;
    ::testing::Test::RecordProperty("energy_drift", std::to_string(drift));
    ::testing::Test::RecordProperty("angular_momentum_drift",
                                    std::to_string((angular(result.state) - turning).norm() / turning.norm()));
    const double allowed = sanitized ? 1e-2 : 1e-3;
    EXPECT_NEAR(mean(totals.size() - tenth, totals.size()), mean(0, tenth), allowed * totals.front());
    const double exchanged = mass.cwiseProduct(state.velocity).colwise().norm().sum();  // Σ m |v|
    EXPECT_LT((linear(result.state) - before).norm(), 1e-3 * exchanged);
    EXPECT_LT((angular(result.state) - turning).norm(), 0.01 * turning.norm());  // float32 loses 5e-9 of it a step
}

/// A block between plates that swings from a multiple of one shape.
class SwingingBlock {
public:
    explicit SwingingBlock(Kind kind) : engine_(make_engine(kind, rest_)) {
        engine_->set_conditions(between_plates(model_, Vector3d::Zero()));
    }

    /// Displacement after twenty steps from `size` mm, over `size`.
    Matrix3Xd swung(double size) {
        engine_->set_state(size * tled::scene::wavy(model_.mesh.nodes), Matrix3Xd::Zero(3, rest_.node_count));
        engine_->run(20, coefficients_);
        return engine_->displacement() / size;
    }

private:
    tled::Model model_ = box({20, 20, 20}, {8, 8, 8}, tled::neo_hookean_lnj(3.0, 0.3), tled::Element::T4);
    tled::RestState rest_ = tled::rest_state(model_);
    tled::StepCoefficients coefficients_ = tled::scene::stable_coefficients(model_, rest_);
    std::unique_ptr<tled::Engine> engine_;
};

/// Exponent of the smallest normal number of an engine.
int smallest_exponent(Kind kind) {
    return std::ilogb(kind == Kind::CpuFloat64 ? std::numeric_limits<double>::min()
                                               : std::numeric_limits<float>::min());
}

// Motion that dies away passes through numbers below 1e-38, which many processors handle a hundred times slower. A
// failure looks like: steps that take ten times as long at the end.
TEST_P(LongRun, DenormalNumbersDoNotSlowARun) {
    SwingingBlock block(GetParam());
    const auto seconds = [&](double size) {  // of all threads of this process: others on the machine do not count
        double best = 1e9;
        for (int repeat = 0; repeat < 5; ++repeat) {
            const std::clock_t begin = std::clock();
            EXPECT_TRUE(block.swung(size).allFinite());
            best = std::min(best, double(std::clock() - begin) / CLOCKS_PER_SEC);
        }
        return best;
    };
    const double ordinary = seconds(0.1), denormal = seconds(std::ldexp(1.0, smallest_exponent(GetParam()) - 7));
    EXPECT_LT(denormal, 10 * ordinary);
}

// Below strains of 1e-7 the motion is linear: scaled by a power of two it is the same. A failure looks like: stress
// that is lost in the rounding of 1 + strain, or products of small numbers that vanish and take a term with them.
TEST_P(LongRun, SmallMotionsAreThoseOfLinearElasticityDownToDenormalNumbers) {
    SwingingBlock block(GetParam());
    const Matrix3Xd linear = block.swung(std::ldexp(1.0, -20));
    const int smallest = smallest_exponent(GetParam());
    for (const int exponent : {-40, -60, smallest + 26})
        EXPECT_LT((block.swung(std::ldexp(1.0, exponent)) - linear).norm(), 1e-5 * linear.norm()) << exponent;
    // Denormal numbers have few digits, and a GPU may take them as zero: nothing may come of it that is larger.
    EXPECT_LT(distance(block.swung(std::ldexp(1.0, smallest - 7)), linear),
              1.01 * std::sqrt(linear.colwise().squaredNorm().maxCoeff()));
}

// A failure looks like: a run that blows up after an accepted step.
TEST_P(LongRun, StepsAboveTheCriticalOneAreRefusedAndBelowItAreStable) {
    const tled::Model model = box({20, 20, 20}, {3, 3, 3}, tled::neo_hookean_lnj(3.0, 0.45));
    const tled::RestState rest = tled::rest_state(model);
    const auto engine = make_engine(GetParam(), rest);
    const Matrix3Xd mass = rest.lumped_mass.transpose().replicate(3, 1);
    const tled::NodalConditions conditions = between_plates(model, Vector3d::Zero());
    tled::DynamicsState state{Matrix3Xd::Zero(3, rest.node_count), Matrix3Xd::Zero(3, rest.node_count), 0};
    state.velocity.row(1).setConstant(20);
    const double critical = tled::dynamics(*engine, rest, mass, conditions, state, 0.001).critical_step;
    EXPECT_THROW(tled::dynamics(*engine, rest, mass, conditions, state, 0.1, {.step = 1.02 * critical}), InvalidInput);
    const auto result = tled::dynamics(*engine, rest, mass, conditions, state, 0.5, {.step = 0.95 * critical});
    EXPECT_LT(result.energy.largest_growth, 0.02);
    EXPECT_LT(result.state.displacement.colwise().norm().maxCoeff(), 5.0);
}

}  // namespace
}  // namespace tissuewarp::stability
