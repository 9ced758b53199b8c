#pragma once
/// From report.json to the values that the page's template names: numbers as texts with the decimals they deserve.

#include <nlohmann/json.hpp>

namespace tissuewarp::report::detail {

/// Missing or odd entries of the report leave their part of the view out.
nlohmann::json view_of(const nlohmann::json& report);

}  // namespace tissuewarp::report::detail
