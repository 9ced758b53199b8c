#include "registration/detail/load_finder.hpp"

#include "registration/detail/coarse_twin.hpp"
#include "registration/detail/unknown_loads.hpp"

#include <utility>

namespace tissuewarp::registration::detail {

namespace {

constexpr int most_nodes = 6000;

Eigen::VectorXd forces_of(const std::vector<tled::Spring>& springs, Eigen::Index rows) {
    Eigen::VectorXd forces = Eigen::VectorXd::Zero(rows);
    for (const tled::Spring& spring : springs) forces.segment<3>(3 * spring.node) += spring.stiffness * spring.target;
    return forces;
}

}  // namespace

FoundLoads LoadFinder::find(LoadKind kind, const LastPulls& pulls, Observer& observer) {
    if (prepared_.rest.node_count <= most_nodes) return found(kind, prepared_, pulls);
    if (!twin_) twin_ = coarse_model(prepared_, suggested_edge_length_without_labels(prepared_.labels), observer);
    return found(kind, *twin_, pulls_on(*twin_, prepared_, pulls));
}

Eigen::MatrixXd LoadFinder::loads(LoadKind kind, const PreparedModel& model) const {
    return kind == LoadKind::Weight ? unknown_weights(model) : principal_loads(model, count_);
}

const LoadFinder::Shapes& LoadFinder::shapes(LoadKind kind, const PreparedModel& model, const WeighedSprings& unseen) {
    std::optional<Shapes>& shapes = shapes_[static_cast<std::size_t>(kind)];
    if (!shapes) {
        LoadShapes known(loads(kind, model), Posterior(model, unseen), unseen.energy);
        Eigen::MatrixXd forces = known.scale() * loads(kind, prepared_);
        shapes.emplace(Shapes{std::move(known), std::move(forces)});
    }
    return *shapes;
}

FoundLoads LoadFinder::found(LoadKind kind, const PreparedModel& model, const LastPulls& pulls) {
    const WeighedSprings unseen{pulls.supports, pulls.ground, pulls.energy, pulls.free_placement};
    WeighedSprings seen = unseen;
    seen.data.insert(seen.data.end(), pulls.data.begin(), pulls.data.end());
    const Shapes& of_kind = shapes(kind, model, unseen);
    const Posterior posterior(model, seen);
    const LoadFit fit(of_kind.known, posterior);
    const Eigen::VectorXd shown = posterior.inverse(forces_of(pulls.data, 3 * Eigen::Index{model.rest.node_count}));
    const double size = fit.likeliest_size(shown);
    const Eigen::VectorXd forces = of_kind.forces * fit.coefficients(shown, size);
    return {Eigen::Map<const Eigen::Matrix3Xd>(forces.data(), 3, forces.size() / 3), size};
}

}  // namespace tissuewarp::registration::detail
