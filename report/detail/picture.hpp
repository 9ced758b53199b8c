#pragma once
/// preview.png: three planes through the place that moved most, before and after.

#include "report/detail/display.hpp"

namespace tissuewarp::report::detail {

struct Preview {
    cv::Mat picture;                           ///< 8-bit BGR
    std::optional<Focus> focus;                ///< where tissue moved most, when there is a field
    double displacement_mm = 1, error_mm = 1;  ///< ends of the colour bars
};

/// Rows: axial, coronal, sagittal. Columns, as far as the data is there: before, after, the two differences, the
/// estimated error over the fixed image, and the displacement over the moving image.
Preview draw_preview(const ReportInput& input);

/// Moving to fixed, from the report's "alignment" entry; the identity without one.
Eigen::Isometry3d alignment_of(const nlohmann::json& report);

}  // namespace tissuewarp::report::detail
