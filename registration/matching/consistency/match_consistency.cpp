#include "registration/matching/consistency/local_affine.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration {

namespace {

detail::ScatteredMotion motion_of(const std::vector<BlockMatch>& matches) {
    const auto count = static_cast<Eigen::Index>(matches.size());
    detail::ScatteredMotion motion{Eigen::Matrix3Xd(3, count), Eigen::Matrix3Xd(3, count),
                                   std::vector<Eigen::Matrix3d>(matches.size())};
    tbb::parallel_for(std::size_t{0}, matches.size(), [&](std::size_t n) {
        const auto column = static_cast<Eigen::Index>(n);
        motion.points.col(column) = matches[n].moving;
        motion.displacements.col(column) = matches[n].fixed - matches[n].moving;
        motion.weights[n] = detail::neighbour_weight(matches[n]);
    });
    return motion;
}

}  // namespace

std::vector<BlockMatch> consistent_matches(const std::vector<BlockMatch>& matches, const ConsistencyOptions& options) {
    std::vector<BlockMatch> candidates;
    std::copy_if(matches.begin(), matches.end(), std::back_inserter(candidates),
                 [&](const BlockMatch& match) { return match.confidence >= options.least_confidence; });
    const detail::ScatteredMotion motion = motion_of(candidates);
    const auto neighbours = detail::nearest_neighbours(motion.points, options.neighbours);
    const std::vector<detail::LocalMotion> story =
        detail::fit_local_affine(motion, motion.points, neighbours, options.trimmed_share);
    std::vector<char> agrees(candidates.size(), 0);
    tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t n) {
        const auto column = static_cast<Eigen::Index>(n);
        const Eigen::Vector3d e = motion.displacements.col(column) - story[n].displacement;
        const double residual = std::sqrt(e.dot(motion.weights[n] * e) / candidates[n].confidence);
        agrees[n] = std::max(residual, story[n].residual_mm) <= options.most_residual_mm;
    });
    std::vector<BlockMatch> result;
    for (std::size_t n = 0; n < candidates.size(); ++n)
        if (agrees[n]) result.push_back(candidates[n]);
    return result;
}

}  // namespace tissuewarp::registration
