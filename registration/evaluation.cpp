#include "registration/evaluation.hpp"

#include "core/errors.hpp"
#include "registration/evaluation/percentile.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

namespace tissuewarp::registration {

using detail::percentile;

Summary summarise(std::vector<double> values) {
    Summary summary;
    if (values.empty()) return summary;
    if (!std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); }))
        throw InvalidInput("summary: a value is not finite; remove it first");
    summary.count = static_cast<int>(values.size());
    summary.mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
    summary.median = percentile(values, 50.0);
    summary.percentile_95 = percentile(values, 95.0);
    summary.maximum = *std::max_element(values.begin(), values.end());
    return summary;
}

TargetError target_error(const Landmarks& landmarks, const Eigen::Matrix3Xd& mapped, double moved_mm) {
    if (landmarks.moving.cols() != landmarks.fixed.cols() || landmarks.moving.cols() != mapped.cols())
        throw InvalidInput("target error: " + std::to_string(landmarks.moving.cols()) + " moving, " +
                           std::to_string(landmarks.fixed.cols()) + " fixed and " + std::to_string(mapped.cols()) +
                           " mapped points; their numbers must agree");
    std::vector<double> before, after, moved_before, moved_after;
    for (Eigen::Index p = 0; p < mapped.cols(); ++p) {
        if (!mapped.col(p).allFinite()) continue;
        before.push_back((landmarks.moving.col(p) - landmarks.fixed.col(p)).norm());
        after.push_back((mapped.col(p) - landmarks.fixed.col(p)).norm());
        if (before.back() <= moved_mm) continue;
        moved_before.push_back(before.back());
        moved_after.push_back(after.back());
    }
    return {summarise(before), summarise(after), summarise(moved_before), summarise(moved_after), moved_mm};
}

}  // namespace tissuewarp::registration
