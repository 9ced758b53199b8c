#pragma once
/// The studies that `tissuewarp study NAME` runs, one file each.

#include "apps/options.hpp"
#include "core/observer.hpp"
#include "study/coverage.hpp"

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::apps {

/// What accuracy costs in time (docs/manual/study.md). Throws the exceptions of core/errors.hpp, Interrupted where an
/// interrupt left results behind.
void run_accuracy_time_study(const StudyOptions& options);

/// Whether --time-budget and --accuracy keep what they are asked for, on 50 random phantoms.
void run_dial_study(const StudyOptions& options);

/// Whether the intervals of error estimates hold (docs/manual/study.md).
void run_coverage_study(const StudyOptions& options);

/// Files of drawn patients: what a registration is given, and what is true.
void run_patient_study(const StudyOptions& options);

/// Which patients --problems names ("bent:7-9", "ultrasound:7", …), and what is registered to. Throws InvalidInput.
study::CoverageOptions coverage_plan(const StudyOptions& options, Observer& observer);

/// First and last seed of "phantom:FIRST-LAST" or "phantom:SEED", which are the only problems of some studies; without
/// a problem `otherwise`. Throws InvalidInput.
std::pair<std::uint64_t, std::uint64_t> phantom_seeds(const std::vector<std::string>& problems,
                                                      std::pair<std::uint64_t, std::uint64_t> otherwise);

}  // namespace tissuewarp::apps
