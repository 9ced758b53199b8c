/// When viscous stresses move on, and what the schedule does to a stress that follows a strain.
#include "tled/material/stress_clock.hpp"
#include "tled/material/prony_coefficients.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

namespace tissuewarp::tled::detail {
namespace {

const std::vector<PronySeries> two_series{{{{0.3, 2.0}}}, {{{0.4, 0.64}, {0.1, 100.0}}}};

TEST(StressClock, ElasticTissueRestsForAsLongAsItIsAsked) {
    StressClock clock({});
    EXPECT_EQ(clock.next(1000, 0.001), (std::vector<StressSteps>{{1000, 0}}));
    EXPECT_EQ(clock.lag(), 0);
}

TEST(StressClock, TheShortestTimeOfRelaxationSetsThePace) {
    StressClock clock(two_series);  // 0.64/32 = 0.02 s
    const std::vector<StressSteps> steps = clock.next(50, 0.001);
    ASSERT_EQ(steps.size(), 6U);
    for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(steps[i].count, i % 2 == 0 ? 1 : i == 5 ? 9 : 19) << i;
    EXPECT_DOUBLE_EQ(steps[0].interval, 0.01);  // to the middle of the rest
    EXPECT_DOUBLE_EQ(steps[2].interval, 0.02);
    EXPECT_EQ(steps[1].interval, 0);
    EXPECT_NEAR(clock.lag(), 0, 1e-15);
}

// A rest of fewer than sixteen steps would cost more than it saves.
TEST(StressClock, LongTimeStepsMoveStressesEachTime) {
    StressClock clock(two_series);
    const std::vector<StressSteps> steps = clock.next(10, 0.002);
    ASSERT_EQ(steps.size(), 2U);
    EXPECT_EQ(steps[0].count, 1);
    EXPECT_DOUBLE_EQ(steps[0].interval, 0.001);
    EXPECT_EQ(steps[1].count, 9);
    EXPECT_DOUBLE_EQ(steps[1].interval, 0.002);
}

TEST(StressClock, MayBeToldToMoveStressesEachTime) {
    StressClock clock(two_series, StressPace::EveryStep);
    const std::vector<StressSteps> steps = clock.next(10, 0.001);
    ASSERT_EQ(steps.size(), 2U);
    EXPECT_EQ(steps[1].count, 9);
    EXPECT_DOUBLE_EQ(steps[1].interval, 0.001);
}

std::vector<double> intervals(StressClock clock, const std::vector<int>& portions, double time_step) {
    std::vector<double> all;
    for (const int portion : portions)
        for (const auto& [count, interval] : clock.next(portion, time_step)) all.insert(all.end(), count, interval);
    return all;
}

TEST(StressClock, PortionsOfARunAreTheRunToTheLastBit) {
    const double time_step = 0.64 / 32 / 23.4;
    const std::vector<double> at_once = intervals(StressClock(two_series), {400}, time_step);
    std::mt19937 random(7);
    std::vector<int> portions;
    for (int left = 400; left > 0; left -= portions.back())
        portions.push_back(std::min<int>(left, static_cast<int>(random() % 30)));
    EXPECT_EQ(intervals(StressClock(two_series), portions, time_step), at_once);
}

// Whatever the time steps, stresses are never further from the present than half a rest, and all the time is counted.
TEST(StressClock, CountsAllTimeWhenStepsChange) {
    StressClock clock(two_series);
    double time = 0, moved = 0;
    for (const double time_step : {0.001, 0.0003, 0.004, 0.0011, 0.0, 0.0009}) {
        for (const auto& [count, interval] : clock.next(77, time_step)) {
            moved += count * interval;
            time += count * time_step;
        }
        EXPECT_NEAR(time - moved, clock.lag(), 1e-12);
        EXPECT_LE(std::abs(clock.lag()), 0.011);
    }
}

TEST(StressClock, ForgetsWhatWas) {
    StressClock clock(two_series);
    const auto first = clock.next(33, 0.001);
    clock.forget();
    EXPECT_EQ(clock.lag(), 0);
    EXPECT_EQ(clock.next(33, 0.001), first);
}

/// What one term takes off under the strain S(t): the stress of each step of a schedule.
std::vector<double> followed(const PronyTerm& term, const std::function<double(double)>& S, double time_step,
                             int steps) {
    StressClock clock({{{term}}});
    std::vector<double> all;
    double q = 0;
    for (int i = 0; i < steps; ++i) {
        const double interval = clock.next(1, time_step).front().interval;
        const auto [a, b] = prony_coefficients({{term}}, interval).front();
        q = a * S(i * time_step) + b * q;
        all.push_back(q);
    }
    return all;
}

// q of S = sin ωt: g (sin ωt − ωτ cos ωt + ωτ e^(−t/τ))/(1 + ω²τ²). A failure looks like: stresses that are half a rest
// early or late, 1/64 of a radian here.
TEST(StressClock, StressesThatRestAreNeitherEarlyNorLate) {
    const PronyTerm term{0.5, 1.0};
    constexpr double time_step = 0.001;
    constexpr int steps = 20000;
    const std::vector<double> q = followed(
        term, [](double t) { return std::sin(t); }, time_step, steps);
    double late = 0, size = 0, worst = 0;
    for (int i = 0; i < steps; ++i) {
        const double t = i * time_step;
        const double exact = 0.25 * (std::sin(t) - std::cos(t) + std::exp(-t));
        const double rate = 0.25 * (std::cos(t) + std::sin(t) - std::exp(-t));
        late += (exact - q[static_cast<std::size_t>(i)]) * rate;
        size += rate * rate;
        worst = std::max(worst, std::abs(exact - q[static_cast<std::size_t>(i)]));
    }
    EXPECT_LT(std::abs(late / size), time_step);
    EXPECT_LT(worst, 0.36 / 64);  // the greatest rate times half a rest
    EXPECT_GT(worst, 0.3 / 64) << "this schedule does not rest";
}

// A term never gives energy to a vibration, however fast beside its rests (docs/decisions/viscous_steps.md).
TEST(StressClock, StressesThatRestTakeEnergyFromEveryVibration) {
    const PronyTerm term{0.5, 1.0};
    constexpr double time_step = 0.001;
    constexpr int steps = 30000;
    for (double omega = 0.5; omega < 2000; omega *= 1.17) {
        const auto S = [&](double t) { return std::sin(omega * t); };
        const std::vector<double> q = followed(term, S, time_step, steps);
        double work = 0;  // of the stress −q that lies between two steps
        for (int i = steps / 3; i < steps; ++i)
            work -= q[static_cast<std::size_t>(i)] * (S((i + 1) * time_step) - S(i * time_step));
        EXPECT_GT(work, -1e-3) << omega;
        const double exact = 0.25 * 20 * omega * omega / (1 + omega * omega);  // of 20 s, but for parts of cycles
        if (omega < 8) {
            EXPECT_NEAR(work, exact, 0.3) << omega;
        }
    }
}

}  // namespace
}  // namespace tissuewarp::tled::detail
