#include "registration/evaluation/target_bins.hpp"

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "imaging/sampling.hpp"
#include "meshing/search/point_tree.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace tissuewarp::registration {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

void require_edges(const std::vector<double>& edges) {
    double last = 0;
    for (const double edge : edges) {
        if (!(edge > last) || !std::isfinite(edge))
            throw InvalidInput("bins: the edge " + std::to_string(edge) + " mm follows " + std::to_string(last) +
                               " mm; give positive lengths in ascending order");
        last = edge;
    }
}

}  // namespace

std::vector<ErrorBin> bin_errors(const Eigen::VectorXd& errors, const Eigen::VectorXd& coordinates,
                                 const std::vector<double>& edges) {
    require_edges(edges);
    if (errors.size() != coordinates.size() || coordinates.hasNaN())
        throw InvalidInput("bins: " + std::to_string(errors.size()) + " errors with " +
                           std::to_string(coordinates.size()) + " coordinates; one each is needed, none of them NaN");
    std::vector<double> bounds{-infinity, 0.0};
    bounds.insert(bounds.end(), edges.begin(), edges.end());
    bounds.push_back(infinity);
    std::vector<std::vector<double>> values(bounds.size() - 1);
    for (Eigen::Index n = 0; n < errors.size(); ++n) {
        const auto above = std::upper_bound(bounds.begin() + 1, bounds.end() - 1, coordinates[n]);
        values[static_cast<std::size_t>(above - bounds.begin() - 1)].push_back(errors[n]);
    }
    std::vector<ErrorBin> bins;
    for (std::size_t b = values.front().empty() ? 1 : 0; b < values.size(); ++b)
        bins.push_back({bounds[b], bounds[b + 1], summarise(values[b])});
    return bins;
}

Eigen::VectorXd depth_below_surface(const imaging::Volume& labels, const Eigen::Matrix3Xd& points) {
    const imaging::LinearSampler distance(imaging::signed_distance(imaging::mask_of_all(labels)));
    Eigen::VectorXd depths(points.cols());
    for (Eigen::Index p = 0; p < points.cols(); ++p)
        depths[p] = distance.contains(points.col(p)) ? -distance.value(points.col(p)) : -infinity;
    return depths;
}

Eigen::VectorXd distance_to_data(const Eigen::Matrix3Xd& points, const Eigen::Matrix3Xd& data) {
    if (data.cols() == 0 || !data.allFinite())
        throw InvalidInput("distance to data: " + std::to_string(data.cols()) +
                           " data points; at least one is needed, all of them finite");
    const meshing::PointTree tree(data);
    Eigen::VectorXd distances(points.cols());
    for (Eigen::Index p = 0; p < points.cols(); ++p) distances[p] = tree.distance(points.col(p));
    return distances;
}

}  // namespace tissuewarp::registration
