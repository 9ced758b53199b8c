#include "registration/terms/contact.hpp"

#include "imaging/label_extents.hpp"
#include "imaging/labels.hpp"
#include "registration/boundary/surroundings.hpp"
#include "registration/doubts.hpp"
#include "registration/pose/label_boundaries.hpp"
#include "registration/springs/ground_springs.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

constexpr double tolerance_mm = contact_options.tolerance_mm;

/// Of one label, as far as contact asks for it.
imaging::Volume distance_about(const imaging::Volume& labels, int label) {
    constexpr double about_mm = 30;
    const imaging::LabelExtent box = imaging::label_extents(labels).at(label);
    return smooth_distance(
        imaging::mask_in(labels, imaging::grown(box, voxels_of(about_mm, labels.geometry), labels.geometry), label));
}

}  // namespace

ContactTerm::ContactTerm(const PreparedModel& prepared, double energy, std::vector<SeenBody> seen)
    : prepared_(prepared), seen_(std::move(seen)) {
    constexpr double deviation = contact_options.deviation_mm;
    stiffness_ = energy / (deviation * deviation) / ground_options.independent_area;
    std::map<int, double> areas;
    for (const InterfaceNode& node : prepared.interfaces.nodes())
        if (node.outer == 0) areas[node.node] += node.area;
    for (const auto& [node, area] : areas) nodes_.push_back({node, area});
}

ContactTerm::Obstacle ContactTerm::obstacle(const imaging::Volume& distance,
                                            const std::optional<Eigen::Isometry3d>& motion) const {
    Obstacle result{imaging::LinearSampler(distance), {}, motion};
    for (const SurfaceNode& node : nodes_)
        result.rest_depth.push_back(
            std::max(0.0, -double(result.distance.value(prepared_.model.mesh.nodes.col(node.node)))));
    return result;
}

void ContactTerm::know_obstacles(const State& state, Observer& observer) {
    if (!obstacles_.empty()) return;
    const RigidNeighbours& neighbours = *prepared_.neighbours;
    std::vector<int> moved;
    for (const SeenBody& body : seen_) {
        bodies_.push_back(body.motion(state.placement, observer));
        if (!bodies_.back().own) continue;
        moved.push_back(body.label());
        obstacles_.push_back(obstacle(distance_about(neighbours.labels, body.label()), bodies_.back().motion));
    }
    if (moved.empty()) {
        obstacles_.push_back(obstacle(neighbours.distance, std::nullopt));
        return;
    }
    const imaging::Volume others = imaging::without_labels(neighbours.labels, moved);
    if (!imaging::labels_in(others).empty()) obstacles_.push_back(obstacle(smooth_distance(others), std::nullopt));
}

ContactTerm::Gap ContactTerm::gap(std::size_t n, const State& state) const {
    const int node = nodes_[n].node;
    const Eigen::Vector3d place = prepared_.model.mesh.nodes.col(node) + state.displacement.col(node);
    Gap nearest{std::numeric_limits<double>::infinity()};
    for (const Obstacle& obstacle : obstacles_) {
        const Eigen::Isometry3d to_rest =
            obstacle.motion ? obstacle.motion->inverse() * state.placement : Eigen::Isometry3d::Identity();
        const auto [distance, gradient] = obstacle.distance.value_and_gradient(to_rest * place);
        const double gap = distance + obstacle.rest_depth[n];
        if (gap < nearest.distance) nearest = {gap, to_rest.linear().transpose() * gradient.normalized()};
    }
    return nearest;
}

Contribution ContactTerm::linearise(const RoundPlan& plan, const State& state, Observer& observer) {
    know_obstacles(state, observer);
    Contribution result;
    for (std::size_t n = 0; n < nodes_.size(); ++n) {
        const SurfaceNode& node = nodes_[n];
        if (!node.touches) continue;
        const Gap here = gap(n, state);
        const double step = std::clamp(node.push - here.distance, -plan.most_step_mm, plan.most_step_mm);
        result.springs.push_back({{node.node, stiffness_ * node.area * here.normal * here.normal.transpose(),
                                   state.displacement.col(node.node) + step * here.normal},
                                  Origin::Support});
    }
    return result;
}

bool ContactTerm::follow(const State& solved) {
    know_obstacles(solved, silent_observer());
    bool entered = false;
    for (std::size_t n = 0; n < nodes_.size(); ++n) {
        SurfaceNode& node = nodes_[n];
        const double distance = gap(n, solved).distance;
        if (node.touches) {
            node.push = std::max(0.0, node.push - distance);
            node.touches = node.push > 0;
        } else if (distance < -tolerance_mm) {
            node.touches = entered = true;
        }
    }
    return entered;
}

bool ContactTerm::settled(const State& state) const {
    for (std::size_t n = 0; n < nodes_.size(); ++n) {
        const double distance = gap(n, state).distance;
        if (distance <= -tolerance_mm || (nodes_[n].touches && distance >= tolerance_mm)) return false;
    }
    return true;
}

ContactFit ContactTerm::fit(const State& state) const {
    ContactFit fit;
    for (std::size_t n = 0; n < nodes_.size(); ++n) {
        fit.touching += nodes_[n].touches;
        fit.deepest_mm = std::max(fit.deepest_mm, -gap(n, state).distance);
    }
    return fit;
}

void ContactTerm::judge(const State& state, UpdateResult& result) {
    constexpr double most_mm = contact_options.most_depth_mm;
    know_obstacles(state, silent_observer());
    result.contact = fit(state);
    result.bodies = bodies_;
    if (result.contact->deepest_mm > most_mm)
        result.doubts.push_back(
            {"contact.entered", result.contact->deepest_mm, most_mm,
             "the organ lies up to " + to_text(result.contact->deepest_mm) + " mm in a rigid neighbour",
             "check its label and the rigid placement"});
}

}  // namespace tissuewarp::registration::detail
