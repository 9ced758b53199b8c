#include "registration/pose/least_trimmed_motion.hpp"

#include <algorithm>
#include <numeric>
#include <vector>

namespace tissuewarp::registration::detail {

Eigen::Isometry3d least_trimmed_motion(const Eigen::Matrix3Xd& moving, const Eigen::Matrix3Xd& fixed) {
    const auto& [kept_share, concentrations] = least_trimmed_options;
    std::vector<Eigen::Index> order(static_cast<std::size_t>(moving.cols()));
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    const auto kept = static_cast<std::ptrdiff_t>(kept_share * double(order.size()));
    std::vector<char> kept_before, is_kept(order.size());
    Eigen::Isometry3d motion(Eigen::umeyama(moving, fixed, false));
    for (int step = 0; step < concentrations; ++step) {
        const Eigen::VectorXd residual = ((motion * moving) - fixed).colwise().squaredNorm();
        std::nth_element(order.begin(), order.begin() + kept, order.end(),
                         [&](Eigen::Index a, Eigen::Index b) { return residual[a] < residual[b]; });
        const std::vector<Eigen::Index> best(order.begin(), order.begin() + kept);
        kept_before = is_kept;
        std::fill(is_kept.begin(), is_kept.end(), char{0});
        for (const Eigen::Index n : best) is_kept[static_cast<std::size_t>(n)] = 1;
        if (is_kept == kept_before) break;
        motion = Eigen::umeyama(moving(Eigen::all, best), fixed(Eigen::all, best), false);
    }
    return motion;
}

}  // namespace tissuewarp::registration::detail
