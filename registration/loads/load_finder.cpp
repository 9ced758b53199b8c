#include "registration/loads/load_finder.hpp"

#include "registration/loads/coarse_twin.hpp"
#include "registration/loads/unknown_bends.hpp"
#include "registration/loads/unknown_loads.hpp"
#include "registration/springs/ground_springs.hpp"

#include <utility>

namespace tissuewarp::registration::detail {

namespace {

Eigen::VectorXd forces_of(const std::vector<tled::Spring>& springs, Eigen::Index rows) {
    Eigen::VectorXd forces = Eigen::VectorXd::Zero(rows);
    for (const tled::Spring& spring : springs) forces.segment<3>(3 * spring.node) += spring.stiffness * spring.target;
    return forces;
}

}  // namespace

FoundLoads LoadFinder::find(LoadKind kind, const LastPulls& given, Observer& observer) {
    LastPulls pulls = given;
    if (kind == LoadKind::Weight) expect_free_motion(pulls, prepared_, tissue_.free_motion_mm);
    if (!loads_take_coarse_model(prepared_)) return found(kind, prepared_, pulls);
    const PreparedModel& coarse = twin(observer);
    return found(kind, coarse, pulls_on(coarse, prepared_, pulls));
}

const PreparedModel& LoadFinder::twin(Observer& observer) {
    if (prepared_.coarse) return *prepared_.coarse;
    if (!twin_) twin_ = coarse_model_for_loads(prepared_, observer);
    return *twin_;
}

std::pair<Eigen::MatrixXd, Eigen::MatrixXd> LoadFinder::loads(LoadKind kind, const PreparedModel& model) const {
    const bool same = &model == &prepared_;
    if (kind == LoadKind::Weight) {
        Eigen::MatrixXd weights = unknown_weights(model);
        return {weights, same ? weights : unknown_weights(prepared_)};
    }
    const PrincipalBends principal = principal_bends(model, tissue_.load_shapes);
    return {principal.loads, same ? principal.loads : bends_along(prepared_, principal.axes)};
}

const LoadFinder::Shapes& LoadFinder::shapes(LoadKind kind, const PreparedModel& model, const WeighedSprings& unseen) {
    std::optional<Shapes>& shapes = shapes_[static_cast<std::size_t>(kind)];
    if (!shapes) {
        auto [fitted, applied] = loads(kind, model);
        LoadShapes known(std::move(fitted), Posterior(model, unseen), unseen.energy);
        Eigen::MatrixXd forces = known.scale() * applied;
        shapes.emplace(Shapes{std::move(known), std::move(forces)});
    }
    return *shapes;
}

FoundLoads LoadFinder::found(LoadKind kind, const PreparedModel& model, const LastPulls& pulls) {
    const WeighedSprings unseen = without_data(pulls), seen = with_data(pulls);
    const Shapes& of_kind = shapes(kind, model, unseen);
    const Posterior posterior(model, seen);
    const LoadFit fit(of_kind.known, posterior);
    const Eigen::VectorXd shown =
        posterior.inverse(forces_of(pulls.of(Origin::Datum), 3 * Eigen::Index{model.rest.node_count}));
    const double size = kind == LoadKind::Bends
                            ? fit.likeliest_size(shown, {expected_bend_mm(model) / of_kind.known.deviation_mm(),
                                                         bend_draws.log_deviation})
                            : fit.likeliest_size(shown);
    const Eigen::VectorXd forces = of_kind.forces * fit.coefficients(shown, size);
    return {Eigen::Map<const Eigen::Matrix3Xd>(forces.data(), 3, forces.size() / 3), size};
}

}  // namespace tissuewarp::registration::detail
