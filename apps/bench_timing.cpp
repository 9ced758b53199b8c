#include "apps/bench_timing.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>

namespace tissuewarp::apps {

namespace {

using Eigen::Matrix3Xd;

constexpr double safety = 0.9;
constexpr double damping = 0.01;  // α Δt/2
constexpr int least_steps = 5;

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// The displacement after so many steps from the start, in portions between which a stop is heeded.
Matrix3Xd run_from_start(const Stepper& stepper, int steps, const tled::StepCoefficients& coefficients,
                         Observer& observer) {
    constexpr int portion = 20;
    stepper.restart();
    for (int done = 0; done < steps; done += portion) {
        observer.checkpoint("comparison", double(done) / steps);
        stepper.run(std::min(portion, steps - done), coefficients);
    }
    return stepper.displacement();
}

struct Run {
    double seconds_per_step;
    Matrix3Xd displacement;
};

/// The download that waits for the device is timed again alone and taken off.
Run timed_run(const Stepper& stepper, int steps, const tled::StepCoefficients& coefficients) {
    stepper.restart();
    stepper.displacement();  // waits for the uploads
    const double begin = now();
    stepper.run(steps, coefficients);
    Matrix3Xd displacement = stepper.displacement();
    const double middle = now();
    displacement = stepper.displacement();
    return {std::max(1e-9, (middle - begin) - (now() - middle)) / steps, std::move(displacement)};
}

/// NaN where anything is not finite.
double relative_difference(const Matrix3Xd& u, const Matrix3Xd& exact) {
    return u.allFinite() ? (u - exact).cwiseAbs().maxCoeff() / exact.cwiseAbs().maxCoeff() : std::nan("");
}

/// Of equal shapes; NaN are the same as themselves.
bool same_bits(const Matrix3Xd& a, const Matrix3Xd& b) {
    return std::memcmp(a.data(), b.data(), sizeof(double) * static_cast<std::size_t>(a.size())) == 0;
}

}  // namespace

SceneReference scene_reference(const BenchScene& scene, const TimingPlan& plan, Observer& observer) {
    SceneReference reference;
    reference.critical_step = critical_step(scene);
    observer.checkpoint("critical step", 0.5);
    reference.time_step = safety * reference.critical_step;
    reference.coefficients = {(1 - damping) / (1 + damping), reference.time_step * reference.time_step / (1 + damping)};
    if (plan.compared_steps > 0)
        reference.exact =
            run_from_start(make_float64_stepper(scene), plan.compared_steps, reference.coefficients, observer);
    return reference;
}

std::optional<EngineTiming> timed(BenchEngine engine, const BenchScene& scene, const SceneReference& reference,
                                  const BenchDevice& device, const TimingPlan& plan, Observer& observer) {
    const Stepper stepper = make_stepper(engine, scene, device);
    const bool hardware = processor_of(engine) == tled::Processor::Gpu && device.hardware;
    timed_run(stepper, 1, reference.coefficients);  // compiles
    const double first = timed_run(stepper, least_steps, reference.coefficients).seconds_per_step;
    if (!hardware && plan.longest_step > 0 && first > plan.longest_step) return std::nullopt;

    EngineTiming timing;
    timing.engine = engine;
    timing.description = stepper.description;
    timing.work = stepper.work;
    timing.shape = stepper.shape;
    const double fitting = std::min(plan.run_seconds / first, double(plan.steps));
    timing.steps = std::max(static_cast<int>(fitting), std::min(least_steps, plan.steps));
    if (hardware)
        for (const double begin = now(); now() - begin < plan.warm_up_seconds;)
            timed_run(stepper, timing.steps, reference.coefficients);
    Matrix3Xd displacement;
    for (int repeat = 0; repeat < plan.repeats; ++repeat) {
        observer.checkpoint("runs", double(repeat) / plan.repeats);
        Run run = timed_run(stepper, timing.steps, reference.coefficients);
        timing.seconds_per_step.push_back(run.seconds_per_step);
        if (repeat > 0) timing.repeats_equal = timing.repeats_equal && same_bits(run.displacement, displacement);
        displacement = std::move(run.displacement);
    }
    if (!reference.exact) return timing;
    if (timing.steps != plan.compared_steps)
        displacement = run_from_start(stepper, plan.compared_steps, reference.coefficients, observer);
    timing.compared_steps = plan.compared_steps;
    timing.difference = relative_difference(displacement, *reference.exact);
    return timing;
}

}  // namespace tissuewarp::apps
