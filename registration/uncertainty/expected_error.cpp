#include "registration/uncertainty/expected_error.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace tissuewarp::registration {

namespace {

constexpr int places = detail::expected_error_options.places;

std::vector<int> spread_nodes(const Eigen::Matrix3Xd& nodes) {
    std::vector<int> chosen;
    const Eigen::Vector3d middle = nodes.rowwise().mean();
    Eigen::RowVectorXd nearest = (nodes.colwise() - middle).colwise().squaredNorm();
    Eigen::Index node = 0;
    nearest.minCoeff(&node);
    nearest.setConstant(1e30);
    for (int n = 0; n < std::min<int>(places, static_cast<int>(nodes.cols())); ++n) {
        chosen.push_back(static_cast<int>(node));
        nearest = nearest.cwiseMin((nodes.colwise() - nodes.col(node)).colwise().squaredNorm());
        nearest.maxCoeff(&node);
    }
    return chosen;
}

}  // namespace

ExpectedError detail::expected_error(const Eigen::Matrix3Xd& nodes, const Posterior& posterior) {
    const std::vector<int> chosen = spread_nodes(nodes);
    const std::vector<Eigen::Matrix3d> covariances = posterior.covariances(chosen);
    ExpectedError result;
    double sum = 0;
    for (std::size_t place = 0; place < chosen.size(); ++place) {
        const double variance = covariances[place].trace();
        sum += variance;
        if (std::sqrt(variance) <= result.worst_mm) continue;
        result.worst_mm = std::sqrt(variance);
        result.worst_place = nodes.col(chosen[place]);
    }
    result.mean_mm = std::sqrt(sum / double(chosen.size()));
    return result;
}

ExpectedError expected_error(const PreparedModel& prepared, const UpdateResult& result) {
    if (!result.pulls.parts_alone)
        throw InvalidInput("labels or an image show the organ as a whole; uncertainty() tells what they leave");
    return detail::expected_error(prepared.model.mesh.nodes,
                                  detail::Posterior(prepared, detail::with_data(result.pulls)));
}

std::optional<Doubt> doubt_of_data(const ExpectedError& expected) {
    constexpr double most_mm = data_doubt_limits.failed_mm / data_doubt_limits.error_of_expected;
    if (expected.mean_mm <= most_mm) return std::nullopt;
    char text[256];
    std::snprintf(text, sizeof text,
                  "the data show too little of the organ: tissue is expected to lie %.2f mm off, and %.2f mm where "
                  "least is known; show more of it, or give landmarks",
                  expected.mean_mm, expected.worst_mm);
    return Doubt{"data.show_too_little", expected.mean_mm, most_mm, text};
}

}  // namespace tissuewarp::registration
