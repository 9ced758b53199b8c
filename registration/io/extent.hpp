#pragma once
/// How large a cloud of points is, to tell units that cannot be millimetres.

#include "core/errors.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

namespace tissuewarp::registration::detail {

/// Twice the median distance from the median point, mm: stray points do not count. Precondition: finite, not empty.
inline double typical_extent(const Eigen::Matrix3Xd& points) {
    const auto median = [](std::vector<double> values) {
        const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
        std::nth_element(values.begin(), middle, values.end());
        return *middle;
    };
    Eigen::Vector3d centre;
    for (int axis = 0; axis < 3; ++axis) {
        const Eigen::RowVectorXd row = points.row(axis);
        centre[axis] = median({row.begin(), row.end()});
    }
    const Eigen::RowVectorXd distances = (points.colwise() - centre).colwise().norm();
    return 2 * median({distances.begin(), distances.end()});
}

/// Throws InvalidInput where points are less than 3 mm or more than 2 m across; `what` names them, with its verb.
inline void require_millimetres(const Eigen::Matrix3Xd& points, const std::string& what, double least_extent_mm = 3) {
    constexpr double most_extent_mm = 2000;
    const double extent = typical_extent(points);
    if (extent >= least_extent_mm && extent <= most_extent_mm) return;
    std::ostringstream text;
    text << what << " about " << extent << " mm across; coordinates in mm are needed, are these in "
         << (extent < least_extent_mm ? "metres?" : "micrometres?");
    throw InvalidInput(text.str());
}

/// As above for points of any number: of few, which may lie side by side, only what tissue in metres measures at most
/// is refused.
inline void require_millimetres_of_points(const Eigen::Matrix3Xd& points, const std::string& what) {
    constexpr double largest_organ_in_m = 0.5;
    constexpr Eigen::Index few = 10;
    if (points.cols() >= few)
        require_millimetres(points, what);
    else if (points.cols() > 1 && typical_extent(points) > 0)
        require_millimetres(points, what, largest_organ_in_m);
}

}  // namespace tissuewarp::registration::detail
