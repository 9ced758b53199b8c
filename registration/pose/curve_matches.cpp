#include "registration/pose/curve_matches.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissuewarp::registration::detail {

std::vector<CurveMatch> match_curves(const CurveTree& lines, const CurvePoints& points,
                                     const Eigen::Isometry3d& placement, double reach_mm, double max_angle_deg) {
    const Eigen::Isometry3d back = placement.inverse();
    const double least_cosine = std::cos(max_angle_deg * EIGEN_PI / 180);
    std::vector<CurveMatch> result(static_cast<std::size_t>(points.count()));
    tbb::parallel_for(std::size_t{0}, result.size(), [&](std::size_t n) {
        const auto column = static_cast<Eigen::Index>(n);
        const Eigen::Vector3d point = back * points.points.col(column);
        const auto hit = lines.nearest(point, reach_mm, {back.linear() * points.tangents.col(column), least_cosine});
        if (!hit) return;
        const Eigen::Vector3d away = point - hit->point;
        result[n] = {true, *hit, away - hit->tangent * hit->tangent.dot(away)};
    });
    return result;
}

double median_distance(const std::vector<CurveMatch>& matches) {
    std::vector<double> distances;
    for (const CurveMatch& match : matches)
        if (match.found) distances.push_back(match.hit.distance);
    if (distances.empty()) return std::numeric_limits<double>::infinity();
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    return *middle;
}

}  // namespace tissuewarp::registration::detail
