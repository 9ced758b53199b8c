#pragma once
/// tissuewarp bench --tune: the fastest shape of GPU steps on this device, measured and kept for later runs.

#include "apps/options.hpp"
#include "apps/progress.hpp"
#include "tled/step_shape_cache.hpp"

#include <string>

namespace tissuewarp::apps {

/// Prints the tables and writes the cache after each mesh. Throws InvalidInput for options that belong to the studies
/// or where there is no OpenGL device, IoError, GpuUnavailable and Cancelled.
void run_tuning(const BenchOptions& options, ProgressLine& progress);

/// For people: how many lines of the cache could not be used, and where it is.
std::string skipped_lines(const tled::StepShapeCache& cache);

}  // namespace tissuewarp::apps
