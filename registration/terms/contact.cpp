#include "registration/terms/contact.hpp"

#include "registration/doubts.hpp"
#include "registration/springs/ground_springs.hpp"

#include <algorithm>
#include <map>

namespace tissuewarp::registration::detail {

namespace {

constexpr double tolerance_mm = contact_options.tolerance_mm;

}  // namespace

ContactTerm::ContactTerm(const PreparedModel& prepared, double energy)
    : prepared_(prepared), distance_(prepared.neighbours->distance) {
    constexpr double deviation = contact_options.deviation_mm;
    stiffness_ = energy / (deviation * deviation) / ground_options.independent_area;
    std::map<int, double> areas;
    for (const InterfaceNode& node : prepared.interfaces.nodes())
        if (node.outer == 0) areas[node.node] += node.area;
    for (const auto& [node, area] : areas) {
        const double depth = -distance_.value(prepared.model.mesh.nodes.col(node));
        nodes_.push_back({node, area, std::max(0.0, depth)});
    }
}

ContactTerm::Gap ContactTerm::gap(const SurfaceNode& node, const State& state) const {
    const Eigen::Vector3d place = prepared_.model.mesh.nodes.col(node.node) + state.displacement.col(node.node);
    const auto [distance, gradient] = distance_.value_and_gradient(place);
    return {distance + node.rest_depth, gradient.normalized()};
}

Contribution ContactTerm::linearise(const RoundPlan& plan, const State& state, Observer& /*observer*/) {
    Contribution result;
    for (const SurfaceNode& node : nodes_) {
        if (!node.touches) continue;
        const Gap here = gap(node, state);
        const double step = std::clamp(node.push - here.distance, -plan.most_step_mm, plan.most_step_mm);
        result.springs.push_back({{node.node, stiffness_ * node.area * here.normal * here.normal.transpose(),
                                   state.displacement.col(node.node) + step * here.normal},
                                  Origin::Support});
    }
    return result;
}

bool ContactTerm::follow(const State& solved) {
    bool entered = false;
    for (SurfaceNode& node : nodes_) {
        const double distance = gap(node, solved).distance;
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
    return std::all_of(nodes_.begin(), nodes_.end(), [&](const SurfaceNode& node) {
        const double distance = gap(node, state).distance;
        return distance > -tolerance_mm && (!node.touches || distance < tolerance_mm);
    });
}

ContactFit ContactTerm::fit(const State& state) const {
    ContactFit fit;
    for (const SurfaceNode& node : nodes_) {
        fit.touching += node.touches;
        fit.deepest_mm = std::max(fit.deepest_mm, -gap(node, state).distance);
    }
    return fit;
}

void ContactTerm::judge(const State& state, UpdateResult& result) {
    constexpr double most_mm = contact_options.most_depth_mm;
    result.contact = fit(state);
    if (result.contact->deepest_mm > most_mm)
        result.doubts.push_back(
            {"contact.entered", result.contact->deepest_mm, most_mm,
             "the organ lies up to " + to_text(result.contact->deepest_mm) + " mm in a rigid neighbour",
             "check its label and the rigid placement"});
}

}  // namespace tissuewarp::registration::detail
