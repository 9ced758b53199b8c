#include "registration/terms/view_prior.hpp"

#include "registration/springs/ground_springs.hpp"

#include <tbb/parallel_for.h>

namespace tissuewarp::registration::detail {

namespace {

/// Which nodes of the organ's outer surface could be shown with the organ placed so; 0 for all other nodes.
std::vector<char> surface_in_view(const PreparedModel& prepared, const FieldOfView& view,
                                  const Eigen::Isometry3d& placement) {
    const std::vector<InterfaceNode>& interfaces = prepared.interfaces.nodes();
    std::vector<char> result(static_cast<std::size_t>(prepared.model.mesh.node_count()));
    tbb::parallel_for(std::size_t{0}, interfaces.size(), [&](std::size_t n) {
        const int node = interfaces[n].node;
        if (interfaces[n].outer != 0) return;
        const Eigen::Vector3d place = placement * Eigen::Vector3d(prepared.model.mesh.nodes.col(node));
        result[static_cast<std::size_t>(node)] = view.distance(place) < view_prior_options.margin_mm;
    });
    return result;
}

}  // namespace

double share_in_view(const PreparedModel& prepared, const FieldOfView& view) {
    double all = 0, seen = 0;
    const std::vector<char> shown = surface_in_view(prepared, view, Eigen::Isometry3d::Identity());
    for (const InterfaceNode& node : prepared.interfaces.nodes()) {
        if (node.outer != 0) continue;
        all += node.area;
        if (shown[static_cast<std::size_t>(node.node)]) seen += node.area;
    }
    return all > 0 ? seen / all : 0;
}

ViewPrior::ViewPrior(const PreparedModel& prepared, const FieldOfView& view, const ImageOptions& options, double energy)
    : prepared_(prepared), view_(view), options_(options), energy_(energy) {}

Contribution ViewPrior::linearise(const RoundPlan& /*plan*/, const State& state, Observer& /*observer*/) {
    if (springs_.empty() || !placement_.isApprox(state.placement, 0)) {
        placement_ = state.placement;
        const std::vector<char> shown = surface_in_view(prepared_, view_, placement_);
        springs_ = ground_springs(prepared_, energy_, [&](const InterfaceNode& node) {
            return shown[static_cast<std::size_t>(node.node)]
                       ? ExpectedMotion(options_.expected_motion_mm)
                       : ExpectedMotion(options_.unseen_motion_mm, options_.unseen_slide_mm);
        });
    }
    return {.springs = pulled_by(Origin::Prior, springs_)};
}

}  // namespace tissuewarp::registration::detail
