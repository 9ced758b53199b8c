#pragma once
/// How far points along vessels, seen during the operation, lie from where a registration put the preoperative lines.

#include "registration/evaluation.hpp"

#include <vector>

namespace tissuewarp::registration {

struct CurveResidual {
    Summary to_lines;     ///< mm, from each intraoperative point to the nearest place on a line
    Summary from_lines;   ///< mm, from places along the lines, where pieces show them, to the nearest place on a piece;
                          ///< count 0 without pieces
    double shown_mm = 0;  ///< length of the lines that pieces show
};

/// Residual of points (3 × P, LPS mm) at lines (3 × P each, two points at least) in the same frame. `pieces` are the
/// points' indices, in order along a vessel, two at least each. A piece shows what lies on one line between the places
/// nearest to two of its points in a row: of lines that were seen in part the rest is not asked for. Places along lines
/// are `step_mm` apart. Throws InvalidInput without a line, without a point, and for any that is not finite.
CurveResidual curve_residual(const std::vector<Eigen::Matrix3Xd>& lines, const Eigen::Matrix3Xd& points,
                             const std::vector<std::vector<int>>& pieces, double step_mm = 1.0);

}  // namespace tissuewarp::registration
