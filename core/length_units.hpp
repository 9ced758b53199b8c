#pragma once
/// Units of length as headers write them.

#include <optional>
#include <string>

namespace tissuewarp {

/// Millimetres of one unit ("mm", "cm", "µm", "micrometers", "inches", "m", ...; case and quotes ignored), or nothing
/// when it is no known unit of length.
std::optional<double> millimetres_per(const std::string& unit);

}  // namespace tissuewarp
