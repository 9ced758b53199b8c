/// The fastest shape of GPU steps, found by measurement.
#include "tled/step_tuning.hpp"
#include "core/errors.hpp"
#include "tests/tled/engine_scene.hpp"
#include "tled/step_shape_cache.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <set>
#include <stdexcept>

namespace tissuewarp::tled {
namespace {

using namespace scene;

constexpr TuningEffort little{.warm_up_seconds = 0, .run_seconds = 1e-3, .runs = 3, .compared_steps = 10};

/// Takes as long for a step as it is told, and moves as the CPU engine does or, where it is wrong, a little further.
class TestEngine final : public Engine {
public:
    TestEngine(const RestState& rest, double microseconds, double stray)
        : engine_(make_cpu_engine(rest)), microseconds_(microseconds), stray_(stray) {}

    void set_conditions(const NodalConditions& conditions) override { engine_->set_conditions(conditions); }
    void set_mass(const Matrix3Xd& mass) override { engine_->set_mass(mass); }
    void set_state(const Matrix3Xd& u, const Matrix3Xd& v) override { engine_->set_state(u, v); }
    void set_increment(const Matrix3Xd& increment) override { engine_->set_increment(increment); }
    void keep_state() override { engine_->keep_state(); }
    void return_to_kept_state() override { engine_->return_to_kept_state(); }
    void run(int steps, const StepCoefficients& coefficients) override {
        using Clock = std::chrono::steady_clock;
        const auto end = Clock::now() + std::chrono::duration<double, std::micro>(steps * microseconds_);
        engine_->run(std::min(steps, little.compared_steps), coefficients);
        while (Clock::now() < end) {
        }
    }
    [[nodiscard]] Matrix3Xd displacement() const override {
        const Matrix3Xd u = engine_->displacement();
        return u.array() + stray_ * u.cwiseAbs().maxCoeff();
    }
    [[nodiscard]] Matrix3Xd increment() const override { return engine_->increment(); }
    [[nodiscard]] Matrix3Xd residual() override { return engine_->residual(); }
    [[nodiscard]] Matrix3Xd internal_force() override { return engine_->internal_force(); }
    [[nodiscard]] Observation observe() override { return engine_->observe(); }
    [[nodiscard]] SmallestJacobian smallest_jacobian() override { return engine_->smallest_jacobian(); }
    [[nodiscard]] bool admits_inversion() const override { return engine_->admits_inversion(); }
    [[nodiscard]] std::vector<StepPass> step_passes() override { return engine_->step_passes(); }
    [[nodiscard]] std::string description() const override { return "test"; }
    [[nodiscard]] Processor processor() const override { return engine_->processor(); }
    [[nodiscard]] double precision() const override { return engine_->precision(); }

private:
    std::unique_ptr<Engine> engine_;
    double microseconds_, stray_;
};

constexpr GpuStepShape slow{500, 5, 64}, fast{100, 5, 64}, wrong{100, 1, 64}, blown_up{100, 2, 64}, refused{100, 3, 64};

class StepTuning : public ::testing::Test {
protected:
    RestState rest = rest_state(cube(3, Cells::T4, Laws::LnJ));
    StepShapeEngine engines = [this](const GpuStepShape& shape) -> std::unique_ptr<Engine> {
        if (shape == refused) throw GpuUnavailable("no room");
        const double stray = shape == wrong ? 3e-4 : shape == blown_up ? std::nan("") : 2e-5 * (shape == fast);
        return std::make_unique<TestEngine>(rest, shape == slow ? 10000 : 200, stray);
    };
    std::vector<StepShapeTiming> timed(const std::vector<GpuStepShape>& shapes) {
        return timed_gpu_step_shapes(rest, shapes, engines, little);
    }
};

// The first, or the slowest, would be kept as the best.
TEST_F(StepTuning, TheFastestComesFirst) {
    for (const auto& shapes : {std::vector{slow, fast}, std::vector{fast, slow}}) {
        const std::vector<StepShapeTiming> timings = timed(shapes);
        ASSERT_EQ(timings.size(), 2U);
        EXPECT_EQ(timings[0].shape, fast);
        EXPECT_EQ(timings[1].shape, slow);
        for (const StepShapeTiming& timing : timings) EXPECT_EQ(timing.fault, "");
    }
}

/// Keeps what it is told.
struct Listener final : Observer {
    void note(std::string_view message) override { notes.emplace_back(message); }
    bool cancel_requested() override { return cancels && ++polls > 2; }
    std::vector<std::string> notes;
    bool cancels = false;
    int polls = 0;
};

// A shape that computes nonsense is often fast.
TEST_F(StepTuning, WhatIsWrongOrRefusedIsOutAndSaid) {
    Listener listener;
    const std::vector<StepShapeTiming> timings =
        timed_gpu_step_shapes(rest, {slow, wrong, refused, blown_up}, engines, little, listener);
    ASSERT_EQ(timings.size(), 4U);
    EXPECT_EQ(timings[0].shape, slow);
    EXPECT_EQ(timings[1].shape, wrong);
    EXPECT_NE(timings[1].fault.find("0.0003"), std::string::npos) << timings[1].fault;
    EXPECT_EQ(timings[2].fault, "no room");
    EXPECT_NE(timings[3].fault.find("not finite"), std::string::npos) << timings[3].fault;
    for (std::size_t i = 1; i < 4; ++i) EXPECT_EQ(timings[i].seconds_per_step, 0);
    ASSERT_EQ(listener.notes.size(), 3U);
    EXPECT_NE(listener.notes[1].find(name_of(refused)), std::string::npos) << listener.notes[1];
}

// Everything after a first shape that the device refuses would have nothing to agree with.
TEST_F(StepTuning, TheFirstThatWorksIsTheMeasure) {
    const std::vector<StepShapeTiming> timings = timed({refused, blown_up, slow, wrong});
    EXPECT_EQ(timings.front().shape, slow);
    EXPECT_FALSE(timings[1].fault.empty() || timings[2].fault.empty() || timings[3].fault.empty());
}

TEST_F(StepTuning, NothingLeftIsAnError) {
    EXPECT_THROW(timed({refused, blown_up}), GpuUnavailable);
    EXPECT_THROW(timed({}), GpuUnavailable);
}

TEST_F(StepTuning, StopsWhenAsked) {
    Listener listener;
    listener.cancels = true;
    EXPECT_THROW(timed_gpu_step_shapes(rest, {slow, fast}, engines, little, listener), Cancelled);
    EXPECT_LT(listener.polls, 5);
}

// The real engine on this machine's device: the table is in order, what it calls the best computes what two passes do,
// and a shape that the device has no room for is out.
TEST_F(StepTuning, OnADeviceTheBestAgreesWithTwoPasses) {
    const GpuStepShape impossible{100, 5, 1 << 20};
    const std::vector<StepShapeTiming> timings = timed_gpu_step_shapes(
        rest, {{}, small_patches, {60, 2, 32}, impossible},
        [this](const GpuStepShape& shape) { return make_gpu_engine(rest, -1, shape); }, little);
    ASSERT_EQ(timings.size(), 4U);
    EXPECT_EQ(timings.back().shape, impossible);
    EXPECT_FALSE(timings.back().fault.empty());
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(timings[i].fault, "");
    for (std::size_t i = 1; i < 3; ++i) EXPECT_LE(timings[i - 1].seconds_per_step, timings[i].seconds_per_step);
    const auto after = [this](const GpuStepShape& shape) {
        const auto engine = make_gpu_engine(rest, -1, shape);
        engine->set_state(wavy(rest.position, 0.1), Matrix3Xd::Zero(3, rest.node_count));
        engine->run(20, stable_coefficients(cube(3, Cells::T4, Laws::LnJ), rest));
        return engine->displacement();
    };
    const Matrix3Xd two_passes = after({});
    EXPECT_LT(largest(after(timings.front().shape) - two_passes), 1e-5 * largest(two_passes));
}

// Fibres are not for patches: all shapes would be the same two passes, timed a dozen times.
TEST(StepTuningOfAnyScene, RefusesWhatPatchesDoNotKnow) {
    const RestState fibres = rest_state(cube(2, Cells::T4, Laws::Fibres));
    EXPECT_THROW(tuned_gpu_step_shape(fibres, -1, silent_observer(), little), InvalidInput);
}

// A shape twice is time lost; one that needs more than OpenGL grants is a fault for certain.
TEST(CandidateStepShapes, AreAboutTenOfUseWithTwoPassesAndTheSuggested) {
    for (const int multiprocessors : {0, 4, 30, 132})
        for (const Element element : {Element::T4, Element::AveragedPressureT4})
            for (const int elements : {1, 750, 6000, 16464, 82944, 384000, 998250, 3072000, 10110954}) {
                const auto shapes = candidate_gpu_step_shapes(elements, element, multiprocessors);
                const std::string where = std::to_string(elements) + " on " + std::to_string(multiprocessors);
                EXPECT_EQ(shapes.at(0), GpuStepShape{}) << where;
                EXPECT_EQ(shapes.at(1), suggested_gpu_step_shape(elements, element, multiprocessors)) << where;
                EXPECT_GE(shapes.size(), 5U) << where;
                EXPECT_LE(shapes.size(), 13U) << where;
                std::set<std::string> names;
                for (const GpuStepShape& shape : shapes) {
                    EXPECT_TRUE(names.insert(name_of(shape)).second) << name_of(shape) << ", " << where;
                    EXPECT_LE(shape.workgroup, 1024);
                    EXPECT_LE(shape.patch_tets, 4450);
                    EXPECT_TRUE(shape.longest_fan >= 1 && shape.longest_fan <= 5);
                }
            }
}

// Patches that are no multiple of the multiprocessors leave some of these idle.
TEST(SuggestedStepShape, SharesOutAmongTheMultiprocessorsOfTheDevice) {
    const auto patches = [](int elements, const GpuStepShape& shape) { return (elements - 1) / shape.patch_tets + 1; };
    for (const int multiprocessors : {20, 84, 132})
        for (const int elements : {82944, 384000, 998250, 3072000}) {
            const GpuStepShape shape = suggested_gpu_step_shape(elements, Element::T4, multiprocessors);
            const int left_over = patches(elements, shape) % multiprocessors;
            EXPECT_TRUE(left_over == 0 || left_over > 0.9 * multiprocessors)
                << elements << " on " << multiprocessors << ": " << patches(elements, shape);
            EXPECT_EQ(shape.at_once % multiprocessors, 0);
        }
    EXPECT_EQ(suggested_gpu_step_shape(82944), suggested_gpu_step_shape(82944, Element::T4, 132));
    EXPECT_EQ(suggested_gpu_step_shape(82944), (GpuStepShape{629, 2, 512, 132}));
}

}  // namespace
}  // namespace tissuewarp::tled
