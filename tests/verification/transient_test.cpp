// Vibration and relaxation against data/reference, on every engine.

#include "tests/verification/transient.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tissuewarp::verification {
namespace {

using tled::Element;

struct NamedEngine {
    const char* name;
    MakeEngine make;
};
void PrintTo(const NamedEngine& engine, std::ostream* out) {
    *out << engine.name;
}
const NamedEngine float64{
    "CpuFloat64", [](const tled::RestState& rest) { return tled::make_cpu_engine(rest, tled::Scalar::Float64); }};
const NamedEngine float32{
    "CpuFloat32", [](const tled::RestState& rest) { return tled::make_cpu_engine(rest, tled::Scalar::Float32); }};
const NamedEngine gpu{"Gpu", [](const tled::RestState& rest) { return tled::make_gpu_engine(rest); }};

double period_of(const BarReference& reference, int cells) {
    const Element element = reference.poisson > 0.4 ? Element::AveragedPressureT4 : Element::T4;
    return bar_period(reference.poisson, reference.end, element, cells, float64.make);
}

// Smooth modes: second order, so 2 and 4 cells across extrapolate to 1e-4 of the period.
TEST(BarVibration, RollerPeriodsConvergeToTheReference) {
    for (const BarReference& reference : bar_references()) {
        if (reference.end != BarEnd::Roller) continue;
        const double coarse = period_of(reference, 2), fine = period_of(reference, 4);
        EXPECT_NEAR(fine + (fine - coarse) / 3, reference.period, 1.2e-4 * reference.period) << reference.poisson;
        EXPECT_LT(std::abs(fine - reference.period), 4e-4 * reference.period) << reference.poisson;
    }
}

// The clamped edge is singular: the order is that which three meshes show, about 1.
TEST(BarVibration, ClampedPeriodsConvergeToTheReference) {
    for (const BarReference& reference : bar_references()) {
        if (reference.end != BarEnd::Clamped) continue;
        const double coarse = period_of(reference, 2), middle = period_of(reference, 4), fine = period_of(reference, 8);
        const double ratio = (middle - coarse) / (fine - middle), extrapolated = fine + (fine - middle) / (ratio - 1);
        EXPECT_GT(ratio, 1.6) << reference.poisson;
        EXPECT_NEAR(fine, reference.period, 0.005 * reference.period) << reference.poisson;
        EXPECT_NEAR(extrapolated, reference.period, reference.uncertainty + 0.5 * std::abs(extrapolated - fine))
            << reference.poisson;
    }
}

class Transient : public ::testing::TestWithParam<NamedEngine> {};
INSTANTIATE_TEST_SUITE_P(All, Transient, ::testing::Values(float64, float32, gpu),
                         [](const auto& each) { return each.param.name; });

TEST_P(Transient, PeriodIsTheSameOnEveryEngine) {
    const double expected = bar_period(0.49, BarEnd::Clamped, Element::AveragedPressureT4, 2, float64.make);
    EXPECT_NEAR(bar_period(0.49, BarEnd::Clamped, Element::AveragedPressureT4, 2, GetParam().make), expected,
                2e-4 * expected);
}

// Strains that stay relax exactly, whatever the steps of the stresses; a ramp to some 1e-4 at Δt = τ/400, where
// stresses move with every step, and at τ/4000, where they rest for 124 steps.
TEST_P(Transient, ImposedStrainsRelaxAsTheClosedForm) {
    for (const double time_step : {0.00125, 0.000125})
        for (const Relaxation& found : imposed_relaxation(time_step, 0.5, GetParam().make)) {
            const bool ramp = found.name == "shear ramp";
            const double range = std::abs(found.reference.back() - found.reference[ramp ? 2 : 0]);
            for (std::size_t i = 0; i < found.time.size(); ++i)
                EXPECT_NEAR(found.computed[i], found.reference[i],
                            (ramp ? 2e-3 : 1e-4) * range + 1e-6 * std::abs(found.reference[i]))
                    << found.name << " " << found.time[i] << " s in steps of " << time_step << " s";
        }
}

TEST_P(Transient, AUniaxialStretchRelaxesWithFreeSides) {
    const Relaxation found = uniaxial_relaxation(GetParam().name == gpu.name ? 0.11 : 0.51, GetParam().make);
    ASSERT_GE(found.time.size(), 2u);
    for (std::size_t i = 0; i < found.time.size(); ++i)
        EXPECT_NEAR(found.computed[i], found.reference[i], 2e-3 * found.reference[i]) << found.time[i];
}

}  // namespace
}  // namespace tissuewarp::verification
