#include "registration/terms/left_behind.hpp"

#include "registration/evaluation/percentile.hpp"
#include "registration/matching/consistency/local_affine.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

double common_miss_mm(const std::vector<BlockMatch>& matches, const std::vector<Eigen::Vector3d>& went,
                      const std::vector<int>& region) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 0;
    for (const int n : region) {
        const auto k = static_cast<std::size_t>(n);
        sum += matches[k].confidence * (matches[k].fixed - went[k]);
        weights += matches[k].confidence;
    }
    return weights > 0 ? (sum / weights).norm() : 0;
}

}  // namespace

LeftBehind left_behind(const std::vector<BlockMatch>& matches, const std::vector<Eigen::Vector3d>& went, int neighbours,
                       double percent) {
    if (matches.size() < static_cast<std::size_t>(neighbours)) return {};
    Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(matches.size()));
    for (std::size_t n = 0; n < matches.size(); ++n) points.col(static_cast<Eigen::Index>(n)) = matches[n].moving;
    const std::vector<std::vector<int>> regions = nearest_neighbours(points, neighbours);
    std::vector<double> misses(matches.size());
    tbb::parallel_for(std::size_t{0}, misses.size(),
                      [&](std::size_t n) { misses[n] = common_miss_mm(matches, went, regions[n]); });
    const auto worst = static_cast<std::size_t>(std::max_element(misses.begin(), misses.end()) - misses.begin());
    return {percentile(misses, percent), matches[worst].moving};
}

}  // namespace tissuewarp::registration::detail
