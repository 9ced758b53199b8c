#include "registration/terms/label_matches.hpp"

#include "registration/evaluation/percentile.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

/// Where the image ends no boundary of the tissue is shown.
bool at_border(const imaging::Geometry& grid, const Eigen::Vector3d& point) {
    constexpr double voxels = 0.5;  // within the outermost voxels' outer halves the map may have been cut
    const Eigen::Vector3d index = grid.index(point);
    for (int axis = 0; axis < 3; ++axis)
        if (index[axis] < voxels || index[axis] > grid.size[static_cast<std::size_t>(axis)] - 1 - voxels) return true;
    return false;
}

/// What may lie beyond a node beside what lay there: where labels slid, the outside in place of the other one, or the
/// other one in place of the outside.
std::vector<int> also_beyond(const InterfaceNode& node, const std::vector<std::array<int, 2>>& sliding) {
    if (node.slides) return {0};
    std::vector<int> labels;
    if (node.outer != 0) return labels;
    for (const auto& [first, second] : sliding) {
        if (first == node.inner) labels.push_back(second);
        if (second == node.inner) labels.push_back(first);
    }
    return labels;
}

}  // namespace

std::vector<Match> match_interfaces(const PreparedModel& prepared, const LabelBoundaryField& fixed,
                                    const imaging::Geometry& fixed_grid, const State& state,
                                    const Eigen::Matrix3Xd& normals, const RoundPlan& plan, double max_angle_deg) {
    const auto& nodes = prepared.interfaces.nodes();
    std::vector<Match> matches(nodes.size());
    tbb::parallel_for(std::size_t{0}, nodes.size(), [&](std::size_t i) {
        const InterfaceNode& node = nodes[i];
        if (std::isnan(node.offset)) return;
        const Eigen::Vector3d normal = state.placement.linear() * normals.col(static_cast<Eigen::Index>(i));
        const Eigen::Vector3d point = state.placement * Eigen::Vector3d(prepared.model.mesh.nodes.col(node.node) +
                                                                        state.displacement.col(node.node));
        double crossing = fixed.crossing(point, normal, node.inner, node.outer, plan.range_mm, max_angle_deg);
        for (const int outer : also_beyond(node, prepared.options.sliding)) {
            const double other = fixed.crossing(point, normal, node.inner, outer, plan.range_mm, max_angle_deg);
            if (!(std::abs(crossing) <= std::abs(other)) && !std::isnan(other)) crossing = other;
        }
        if (std::isnan(crossing) || at_border(fixed_grid, point + crossing * normal)) return;
        const double distance = crossing - node.offset;
        matches[i].found = true;
        matches[i].held_back = std::abs(distance) > plan.most_step_mm;
        matches[i].distance_mm = distance;
    });
    return matches;
}

void leave_out_strays(std::vector<Match>& matches, const Interfaces& interfaces,
                      const std::vector<std::vector<int>>& neighbours, const Eigen::Matrix3Xd& nodes,
                      const Eigen::Matrix3Xd& displacement, const Eigen::Matrix3Xd& normals) {
    std::vector<char> stray(matches.size(), 0);
    tbb::parallel_for(std::size_t{0}, matches.size(), [&](std::size_t i) {
        if (!matches[i].found) return;
        const int node = interfaces.nodes()[i].node;
        const Eigen::Vector3d normal = normals.col(static_cast<Eigen::Index>(i));
        std::vector<double> moves;
        double distances = 0;
        for (const int n : neighbours[i]) {
            const auto near = static_cast<std::size_t>(n);
            if (!matches[near].found) continue;
            const int other = interfaces.nodes()[near].node;
            moves.push_back(normal.dot(displacement.col(other)) + matches[near].distance_mm);
            distances += (nodes.col(other) - nodes.col(node)).norm();
        }
        if (moves.empty()) return;
        const double limit = stray_options.steepest * distances / static_cast<double>(moves.size());
        const double move = normal.dot(displacement.col(node)) + matches[i].distance_mm;
        stray[i] = std::abs(move - percentile(moves, 50)) > limit;
    });
    for (std::size_t i = 0; i < matches.size(); ++i)
        if (stray[i]) matches[i] = {};
}

void weigh(std::vector<Match>& matches, const std::vector<std::vector<int>>& neighbours, double scale_mm) {
    tbb::parallel_for(std::size_t{0}, matches.size(), [&](std::size_t i) {
        if (!matches[i].found) return;
        std::vector<double> near;
        for (const int n : neighbours[i])
            if (const Match& other = matches[static_cast<std::size_t>(n)]; other.found)
                near.push_back(other.distance_mm);
        const double expected = near.empty() ? 0 : percentile(near, 50);
        const double deviation = std::abs(matches[i].distance_mm - expected);
        matches[i].weight = deviation <= scale_mm ? 1 : scale_mm / deviation;
    });
}

void bound(std::vector<Match>& matches, double most_step_mm) {
    for (Match& match : matches) match.distance_mm = std::clamp(match.distance_mm, -most_step_mm, most_step_mm);
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
