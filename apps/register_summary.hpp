#pragma once
/// What a registration prints at its end.

#include "apps/register_run.hpp"

#include <string>

namespace tissuewarp::apps {

/// Stages, errors of landmarks, overlap, doubts.
std::string summary_text(const RegistrationRun& run, double total_seconds);

}  // namespace tissuewarp::apps
