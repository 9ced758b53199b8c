#include "apps/bench_engines.hpp"

#include "core/errors.hpp"
#include "shaders/device.hpp"
#include "tled/reference/scalar_steps.hpp"
#include "tled/render_pass/render_pass_engine.hpp"

#include <algorithm>
#include <memory>

namespace tissuewarp::apps {

namespace {

using Eigen::Matrix3Xd;

Matrix3Xd still(const BenchScene& scene) {
    return Matrix3Xd::Zero(3, scene.rest.node_count);
}

/// What all engines have in common, though they share no class.
template <class AnyEngine>
Stepper stepper_of(std::shared_ptr<AnyEngine> engine, const BenchScene& scene, const tled::StepWork& work) {
    return {engine->description(),
            work,
            std::nullopt,
            [engine, &scene] { engine->set_state(scene.start, still(scene)); },
            [engine](int steps, const tled::StepCoefficients& coefficients) { engine->run(steps, coefficients); },
            [engine] { return engine->displacement(); }};
}

Stepper stepper_with_conditions(std::unique_ptr<tled::Engine> engine, const BenchScene& scene,
                                const tled::StepWork& work) {
    engine->set_conditions(scene.conditions);
    return stepper_of(std::shared_ptr<tled::Engine>(std::move(engine)), scene, work);
}

/// A software rasteriser need not run all patches at the same time, and pays for every invocation and barrier.
tled::GpuStepShape fused_shape(const BenchScene& scene, const BenchDevice& device) {
    if (!device.hardware) return {.patch_tets = 2000, .longest_fan = 5, .workgroup = 32};
    return tled::suggested_gpu_step_shape(scene.rest.element_count(), tled::element_of(scene.rest),
                                          device.multiprocessors);
}

Stepper compute_stepper(const BenchScene& scene, const BenchDevice& device, const tled::GpuStepShape& shape) {
    Stepper stepper = stepper_with_conditions(tled::make_gpu_engine(scene.rest, device.index, shape), scene,
                                              tled::gpu_step_work(scene.rest, shape));
    stepper.shape = shape;
    return stepper;
}

}  // namespace

std::string name_of(BenchEngine engine) {
    constexpr const char* names[] = {"scalar", "simd", "render-passes", "two-pass", "fused"};
    return names[static_cast<int>(engine)];
}

BenchEngine engine_named(const std::string& name) {
    for (const BenchEngine engine : every_bench_engine)
        if (name_of(engine) == name) return engine;
    throw InvalidInput("'" + name + "' is no engine; give scalar, simd, render-passes, two-pass or fused");
}

tled::Processor processor_of(BenchEngine engine) {
    return engine == BenchEngine::Scalar || engine == BenchEngine::Simd ? tled::Processor::Cpu : tled::Processor::Gpu;
}

std::optional<BenchDevice> bench_device(const std::string& name) {
    if (name == "cpu") return std::nullopt;
    const int index = name.starts_with("gpu:") ? std::stoi(name.substr(4)) : -1;
    try {
        const shaders::Device found(index);
        return BenchDevice{found.index(), found.renderer(), found.limits().multiprocessors, found.hardware()};
    } catch (const GpuUnavailable&) {
        if (name != "auto") throw;
        return std::nullopt;
    }
}

Stepper make_stepper(BenchEngine engine, const BenchScene& scene, const BenchDevice& device) {
    switch (engine) {
        case BenchEngine::Scalar:
            return stepper_of(std::make_shared<tled::ScalarSteps>(scene.rest, scene.conditions, scene.mass()), scene,
                              tled::scalar_step_work(scene.rest));
        case BenchEngine::Simd:
            return stepper_with_conditions(tled::make_cpu_engine(scene.rest), scene, tled::cpu_step_work(scene.rest));
        case BenchEngine::RenderPasses:
            return stepper_of(
                std::make_shared<tled::RenderPassEngine>(scene.rest, scene.conditions, scene.mass(), device.index),
                scene, tled::render_pass_step_work(scene.rest));
        case BenchEngine::TwoPass:
            return compute_stepper(scene, device, {});
        case BenchEngine::Fused:
            break;
    }
    return compute_stepper(scene, device, fused_shape(scene, device));
}

Stepper make_float64_stepper(const BenchScene& scene) {
    return stepper_with_conditions(tled::make_cpu_engine(scene.rest, tled::Scalar::Float64), scene, {});
}

}  // namespace tissuewarp::apps
