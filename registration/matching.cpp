#include "registration/detail/matching.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

std::vector<Match> match_interfaces(const PreparedModel& prepared, const LabelBoundaryField& fixed, const State& state,
                                    const Eigen::Matrix3Xd& normals, const RoundPlan& plan, double max_angle_deg) {
    const auto& nodes = prepared.interfaces.nodes();
    std::vector<Match> matches(nodes.size());
    tbb::parallel_for(std::size_t{0}, nodes.size(), [&](std::size_t i) {
        const InterfaceNode& node = nodes[i];
        if (std::isnan(node.offset)) return;
        const Eigen::Vector3d normal = state.placement.linear() * normals.col(static_cast<Eigen::Index>(i));
        const Eigen::Vector3d point = state.placement * Eigen::Vector3d(prepared.model.mesh.nodes.col(node.node) +
                                                                        state.displacement.col(node.node));
        const double crossing = fixed.crossing(point, normal, node.inner, node.outer, plan.range_mm, max_angle_deg);
        if (std::isnan(crossing)) return;
        const double distance = crossing - node.offset;
        matches[i].found = true;
        matches[i].held_back = std::abs(distance) > plan.most_step_mm;
        matches[i].distance_mm = std::clamp(distance, -plan.most_step_mm, plan.most_step_mm);
        matches[i].weight = robust_weight(distance, plan.scale_mm);
    });
    return matches;
}

void trim(std::vector<Match>& matches, double share, double scale_mm) {
    std::vector<double> distances;
    for (const Match& match : matches)
        if (match.found) distances.push_back(std::abs(match.distance_mm));
    if (distances.empty()) return;
    const auto kept = static_cast<std::size_t>((1 - share) * double(distances.size() - 1));
    std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(kept), distances.end());
    const double limit = std::max(distances[kept], scale_mm);
    for (Match& match : matches)
        if (std::abs(match.distance_mm) > limit) match.weight = 0;
}

double mean_residual(const std::vector<Match>& matches) {
    double sum = 0, weights = 0;
    for (const Match& match : matches) {
        sum += match.weight * std::abs(match.distance_mm);
        weights += match.weight;
    }
    return weights > 0 ? sum / weights : 0;
}

}  // namespace tissuewarp::registration::detail
