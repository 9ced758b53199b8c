#pragma once
/// Images, labels and values of the page's viewer: volumes on grids along LPS, packed slice by slice into pictures,
/// which every browser unpacks.

#include "report/detail/display.hpp"
#include "report/page.hpp"

#include <nlohmann/json.hpp>

namespace tissuewarp::report::detail {

/// Most voxels of one volume of the viewer: a page stays below 6 MB, and below what browsers draw on (4096 pixels).
inline constexpr double most_viewer_voxels = 1.6e6;

/// {"grid", "fixed", "before", "after", "labels", "values"}; what its data are missing for is left out.
/// A grid is {"size", "origin" (LPS mm), "spacing" (mm), "columns"}: slice k of a picture lies in row k / columns and
/// column k mod columns of its tiles. Grey images are JPEGs of window levels; "labels" is a PNG whose red, green and
/// blue are the fixed, moving and warped labels, 0 for none; "values" {"grid", "picture", "displacement_mm",
/// "error_mm"} a PNG whose red and green are displacement and estimated error in 255ths of these limits, its blue 80
/// times Trust.
nlohmann::json viewer_volumes(const ReportInput& input, const Box& organ, double displacement_mm, double error_mm);

}  // namespace tissuewarp::report::detail
