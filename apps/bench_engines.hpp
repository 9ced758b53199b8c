#pragma once
/// The engines that the benchmark times, behind one face.

#include "apps/bench_scenes.hpp"
#include "tled/engine.hpp"
#include "tled/step_work.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// In the order of the tables: the seed's loops, SIMD on all threads, fragment shaders of 2007, compute passes over
/// elements and nodes, one dispatch over patches.
enum class BenchEngine { Scalar, Simd, RenderPasses, TwoPass, Fused };
inline constexpr BenchEngine every_bench_engine[] = {BenchEngine::Scalar, BenchEngine::Simd, BenchEngine::RenderPasses,
                                                     BenchEngine::TwoPass, BenchEngine::Fused};

/// "scalar", "simd", "render-passes", "two-pass", "fused": as --engines takes them.
std::string name_of(BenchEngine engine);
/// Throws InvalidInput for another name.
BenchEngine engine_named(const std::string& name);
tled::Processor processor_of(BenchEngine engine);

/// An OpenGL device as the benchmark knows it.
struct BenchDevice {
    int index = -1;           ///< of EGL's devices
    std::string name;         ///< renderer string of OpenGL
    int multiprocessors = 0;  ///< 0 where unknown
    bool hardware = false;
};
/// The device that --device names: "auto" (nothing where there is none), "gpu", "gpu:<n>" or "cpu" (nothing). Throws
/// GpuUnavailable.
std::optional<BenchDevice> bench_device(const std::string& name);

/// One engine on one scene. restart() goes to the scene's start; a download waits for the steps before it.
struct Stepper {
    std::string description;
    tled::StepWork work;
    std::optional<tled::GpuStepShape> shape;  ///< of compute passes and patches
    std::function<void()> restart;
    std::function<void(int steps, const tled::StepCoefficients&)> run;
    std::function<Eigen::Matrix3Xd()> displacement;
};
/// The scene must outlive the stepper; `device` is not read for engines of the processor. Throws GpuUnavailable.
Stepper make_stepper(BenchEngine engine, const BenchScene& scene, const BenchDevice& device);
/// What the others are compared with.
Stepper make_float64_stepper(const BenchScene& scene);

}  // namespace tissuewarp::apps
