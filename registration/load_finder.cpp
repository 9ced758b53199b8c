#include "registration/detail/load_finder.hpp"

#include "registration/detail/coarse_twin.hpp"

namespace tissuewarp::registration::detail {

namespace {

constexpr int most_nodes = 6000;

Eigen::VectorXd forces_of(const std::vector<tled::Spring>& springs, Eigen::Index rows) {
    Eigen::VectorXd forces = Eigen::VectorXd::Zero(rows);
    for (const tled::Spring& spring : springs) forces.segment<3>(3 * spring.node) += spring.stiffness * spring.target;
    return forces;
}

}  // namespace

FoundLoads LoadFinder::find(const LastPulls& pulls, Observer& observer) {
    if (prepared_.rest.node_count <= most_nodes) return found(prepared_, pulls);
    if (!twin_) twin_ = coarse_model(prepared_, suggested_edge_length_without_labels(prepared_.labels), observer);
    return found(*twin_, pulls_on(*twin_, prepared_, pulls));
}

FoundLoads LoadFinder::found(const PreparedModel& model, const LastPulls& pulls) {
    const WeighedSprings unseen{pulls.supports, pulls.ground, pulls.energy, pulls.free_placement};
    WeighedSprings seen = unseen;
    seen.data.insert(seen.data.end(), pulls.data.begin(), pulls.data.end());
    if (!shapes_) {
        shapes_.emplace(model, Posterior(model, unseen), pulls.energy, count_);
        forces_ = shapes_->forces(prepared_);
    }
    const Posterior posterior(model, seen);
    const LoadFit fit(*shapes_, posterior);
    const Eigen::VectorXd shown = posterior.inverse(forces_of(pulls.data, 3 * Eigen::Index{model.rest.node_count}));
    const double size = fit.likeliest_size(shown);
    const Eigen::VectorXd forces = forces_ * fit.coefficients(shown, size);
    return {Eigen::Map<const Eigen::Matrix3Xd>(forces.data(), 3, forces.size() / 3), size};
}

}  // namespace tissuewarp::registration::detail
