#include "registration/detail/expected_error.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

constexpr int places = 16;

std::vector<int> spread_nodes(const Eigen::Matrix3Xd& nodes) {
    std::vector<int> chosen;
    Eigen::RowVectorXd nearest = (nodes.colwise() - nodes.rowwise().mean()).colwise().squaredNorm();
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

ExpectedError expected_error(const PreparedModel& prepared, const WeighedSprings& springs) {
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const std::vector<int> chosen = spread_nodes(nodes);
    const std::vector<Eigen::Matrix3d> covariances = Posterior(prepared, springs).covariances(chosen);
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

}  // namespace tissuewarp::registration::detail
