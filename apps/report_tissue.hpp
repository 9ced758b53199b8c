#pragma once
/// Parts of report.json: tissue that is gone, and tissue that slid.

#include "apps/register_run.hpp"

#include <nlohmann/json.hpp>

namespace tissuewarp::apps {

/// What is gone, before and after.
nlohmann::json resected_json(const RegistrationRun& run);

/// Labels that slide on one another, and how far surfaces went along each other, mm.
nlohmann::json sliding_json(const RegistrationRun& run);

}  // namespace tissuewarp::apps
