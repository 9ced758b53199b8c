#pragma once
/// Timing engines on one scene, and checking what they computed in the same runs.

#include "apps/bench_results.hpp"
#include "core/observer.hpp"

namespace tissuewarp::apps {

struct TimingPlan {
    int repeats = 5;
    int steps = 1000;            ///< of a run; fewer where they would take longer than run_seconds
    int compared_steps = 1000;   ///< 0: no comparison with float64
    double run_seconds = 1;      ///< s
    double warm_up_seconds = 1;  ///< s, of hardware, which takes most of a second to reach its clock under load
    double longest_step = 0;     ///< s; an engine of the processor or of a software rasteriser with longer steps is
                                 ///< left out; 0: none is
};

/// Critical step and float64 displacements of a scene, computed once for all engines.
struct SceneReference {
    double critical_step = 0;               ///< s
    tled::StepCoefficients coefficients;    ///< at 0.9 of it, damped with α Δt/2 = 0.01
    double time_step = 0;                   ///< s
    std::optional<Eigen::Matrix3Xd> exact;  ///< after compared_steps; absent without comparison
};
SceneReference scene_reference(const BenchScene& scene, const TimingPlan& plan, Observer& observer);

/// Throws Cancelled and GpuUnavailable. Nothing where the engine is left out for its slow steps.
std::optional<EngineTiming> timed(BenchEngine engine, const BenchScene& scene, const SceneReference& reference,
                                  const BenchDevice& device, const TimingPlan& plan, Observer& observer);

}  // namespace tissuewarp::apps
