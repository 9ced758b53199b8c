#pragma once
/// The files that a registration leaves behind.

#include "apps/output_folder.hpp"
#include "apps/register_run.hpp"
#include "report/page.hpp"

#include <tbb/task_group.h>
#include <nlohmann/json_fwd.hpp>

namespace tissuewarp::apps {

/// Puts files into the output folder, each in a task of its own, as soon as what they hold is known. `run` and `output`
/// must outlive `tasks`, and what a file holds must not change after its start. wait() on the tasks rethrows the first
/// IoError, or Cancelled.
///
/// The transform, and then what lies in the fixed frame, mesh and surface. The inverse transform comes with it, so that
/// `products.moving_to_fixed` is needed where --write names that.
void start_writing_warped(const RegistrationRun& run, const OutputFolder& output, tbb::task_group& tasks);
/// The field moving to fixed and what is made of it.
void start_writing_forward(const RegistrationRun& run, const OutputFolder& output, tbb::task_group& tasks);
/// Estimated errors, points with theirs, and the record with its doubts.
void start_writing_estimates(const RegistrationRun& run, const OutputFolder& output, tbb::task_group& tasks);

/// What report.html and preview.png show.
report::Pictures draw_pictures(const RegistrationRun& run);

/// report.json, preview.png and report.html.
void write_reports(const nlohmann::json& report, const report::Pictures& pictures, const OutputFolder& output);

}  // namespace tissuewarp::apps
