#pragma once
/// Axial slices of the fixed, moving and warped image as small JPEGs, for the viewer of the page.

#include "report/page.hpp"

#include <string>
#include <vector>

namespace tissuewarp::report::detail {

/// Base64 (RFC 4648) of bytes.
std::string base64(const std::vector<unsigned char>& bytes);

/// [{"mm": "12.5", "fixed": base64, "moving": base64, "warped": base64}, …] from feet to head through the fixed labels,
/// each with the outline of the fixed labels (organ_labels); empty unless all three images are there.
nlohmann::json slice_stack(const ReportInput& input, int count);

}  // namespace tissuewarp::report::detail
