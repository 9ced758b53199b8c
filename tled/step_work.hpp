#pragma once
/// What a step costs by its arithmetic: a counted model, beside which measured times are read (docs/lab/performance.md).

#include "tled/engine.hpp"

namespace tissuewarp::tled {

/// For one element and one step. Bytes: every array once for each pass that reads or writes it, gathers from nodes as
/// if each node were fetched once, parameters of materials not at all; so at least what a cache of any size leaves to
/// memory when the mesh does not fit into it. Operations: additions and multiplications, a division, root or logarithm
/// counted as ten.
struct StepWork {
    double bytes = 0;
    double flops = 0;
};

/// Linear tetrahedra of a neo-Hookean law (lnJ) under imposed displacements, as each engine computes them.
StepWork scalar_step_work(const RestState& rest);       ///< ScalarSteps
StepWork cpu_step_work(const RestState& rest);          ///< make_cpu_engine, float32
StepWork render_pass_step_work(const RestState& rest);  ///< RenderPassEngine
/// make_gpu_engine with that shape; patches as they are cut, whether they fit into shared memory or not.
StepWork gpu_step_work(const RestState& rest, const GpuStepShape& shape);

}  // namespace tissuewarp::tled
