#pragma once
/// One set of names for the page, whichever of two a report uses.

#include <nlohmann/json.hpp>

namespace tissuewarp::report::detail {

/// report.json as the program writes it serves machines: inputs as a list by role with the grids apart, landmarks by
/// time and then by group, bytes. The page wants inputs by name with their geometry, errors by group and then by time,
/// and megabytes. Entries that carry the page's names already stay. Anything but an object becomes an empty one.
nlohmann::json normalised(nlohmann::json report);

}  // namespace tissuewarp::report::detail
