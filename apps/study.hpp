#pragma once
/// The studies that `tissuewarp study NAME` runs, one file each.

#include "apps/options.hpp"

namespace tissuewarp::apps {

/// What accuracy costs in time (docs/manual/study.md). Throws the exceptions of core/errors.hpp, Interrupted where an
/// interrupt left results behind.
void run_accuracy_time_study(const StudyOptions& options);

/// Whether --time-budget and --accuracy keep what they are asked for, on 50 random phantoms.
void run_dial_study(const StudyOptions& options);

}  // namespace tissuewarp::apps
