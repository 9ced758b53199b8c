#include "registration/terms/view_prior.hpp"

#include "registration/springs/ground_springs.hpp"

#include <tbb/parallel_for.h>

namespace tissuewarp::registration::detail {

ViewPrior::ViewPrior(const PreparedModel& prepared, const imaging::Volume& seen, const ImageOptions& options,
                     double energy)
    : prepared_(prepared), options_(options), view_(seen), energy_(energy) {}

std::vector<char> ViewPrior::surface_in_view(const Eigen::Isometry3d& placement) const {
    const std::vector<InterfaceNode>& interfaces = prepared_.interfaces.nodes();
    std::vector<char> result(static_cast<std::size_t>(prepared_.model.mesh.node_count()));
    tbb::parallel_for(std::size_t{0}, interfaces.size(), [&](std::size_t n) {
        const int node = interfaces[n].node;
        if (interfaces[n].outer != 0) return;
        const Eigen::Vector3d place = placement * Eigen::Vector3d(prepared_.model.mesh.nodes.col(node));
        result[static_cast<std::size_t>(node)] = view_.distance(place) < view_prior_options.margin_mm;
    });
    return result;
}

double ViewPrior::share_in_view() const {
    double all = 0, seen = 0;
    const std::vector<char> shown = surface_in_view(Eigen::Isometry3d::Identity());
    for (const InterfaceNode& node : prepared_.interfaces.nodes()) {
        if (node.outer != 0) continue;
        all += node.area;
        if (shown[static_cast<std::size_t>(node.node)]) seen += node.area;
    }
    return all > 0 ? seen / all : 0;
}

const std::vector<tled::Spring>& ViewPrior::springs(const Eigen::Isometry3d& placement) {
    if (springs_.empty() || !placement_.isApprox(placement, 0)) {
        placement_ = placement;
        const std::vector<char> shown = surface_in_view(placement);
        springs_ = ground_springs(prepared_, energy_, [&](const InterfaceNode& node) {
            return shown[static_cast<std::size_t>(node.node)]
                       ? ExpectedMotion(options_.expected_motion_mm)
                       : ExpectedMotion(options_.unseen_motion_mm, options_.unseen_slide_mm);
        });
    }
    return springs_;
}

}  // namespace tissuewarp::registration::detail
