#pragma once
/// The files that a registration leaves behind.

#include "apps/output_folder.hpp"
#include "apps/register_run.hpp"

#include <tbb/task_group.h>
#include <nlohmann/json_fwd.hpp>

#include <string>

namespace tissuewarp::apps {

/// Starts a task that writes the transforms and then one per file for images, fields, mesh, points and record; `run`
/// and `output` must outlive `tasks`. wait() on the tasks rethrows the first IoError, or Cancelled.
void start_writing(const RegistrationRun& run, const OutputFolder& output, tbb::task_group& tasks);

/// report.json, preview.png and report.html.
void write_reports(const RegistrationRun& run, const nlohmann::json& report, const OutputFolder& output);

/// What is printed at the end: stages, errors of landmarks, overlap, doubts.
std::string summary_text(const RegistrationRun& run, double total_seconds);

}  // namespace tissuewarp::apps
