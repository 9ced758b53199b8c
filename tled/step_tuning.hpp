#pragma once
/// Which shape of GPU steps is the fastest for a mesh on a device: measured (docs/decisions/gpu_patches.md).

#include "core/observer.hpp"
#include "tled/engine.hpp"

#include <functional>
#include <string>
#include <vector>

namespace tissuewarp::tled {

/// Two passes, the suggested shape and about ten of its neighbours, without repetition: other fans, workgroups, numbers
/// of patches and of workgroups at once. `multiprocessors` as in suggested_gpu_step_shape.
std::vector<GpuStepShape> candidate_gpu_step_shapes(int element_count, Element element, int multiprocessors);

struct TuningEffort {
    double warm_up_seconds = 1;         ///< s, of each shape: a device at rest takes as long to reach its clock
    double run_seconds = 0.05;          ///< s
    int runs = 5;                       ///< of each shape; their median counts
    int compared_steps = 200;           ///< after which all shapes must agree
    double accepted_difference = 1e-4;  ///< over the largest displacement
};

struct StepShapeTiming {
    GpuStepShape shape;
    double seconds_per_step = 0;  ///< s, median; 0 where there is a fault
    std::string fault;            ///< why the shape is out: the device refuses it, or its displacements are wrong
};

/// Makes an engine that takes its steps in that shape; it may throw GpuUnavailable or InvalidInput.
using StepShapeEngine = std::function<std::unique_ptr<Engine>(const GpuStepShape&)>;

/// Times `shapes` on a mesh of tetrahedra alone, stretched by 2 % along its longest side and held at both ends; the
/// fastest first, those with a fault last. The first without a fault of its own is what the others are compared with.
/// Faults are noted. Throws Cancelled, and GpuUnavailable where no shape is left.
std::vector<StepShapeTiming> timed_gpu_step_shapes(const RestState& rest, const std::vector<GpuStepShape>& shapes,
                                                   const StepShapeEngine& make_engine, const TuningEffort& effort,
                                                   Observer& observer = silent_observer());

/// The same with candidate_gpu_step_shapes of this mesh on a device of make_gpu_engine. A software rasteriser is not
/// warmed up. Throws InvalidInput for scenes that take two passes in any shape.
std::vector<StepShapeTiming> tuned_gpu_step_shape(const RestState& rest, int device = -1,
                                                  Observer& observer = silent_observer(),
                                                  const TuningEffort& effort = {});

}  // namespace tissuewarp::tled
