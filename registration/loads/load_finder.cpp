#include "registration/loads/load_finder.hpp"

#include "registration/loads/coarse_twin.hpp"
#include "registration/loads/unknown_bends.hpp"
#include "registration/loads/unknown_loads.hpp"
#include "registration/springs/ground_springs.hpp"

#include <cmath>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

Eigen::VectorXd forces_of(const std::vector<tled::Spring>& springs, Eigen::Index rows) {
    Eigen::VectorXd forces = Eigen::VectorXd::Zero(rows);
    for (const tled::Spring& spring : springs) forces.segment<3>(3 * spring.node) += spring.stiffness * spring.target;
    return forces;
}

}  // namespace

LoadSearch::LoadSearch(std::shared_ptr<const KindOfLoads> of, const SizePrior& expected_size,
                       const Posterior& with_data, bool followed)
    : kind(std::move(of)), expected(expected_size), fit(kind->known, with_data), may_be_followed(followed) {}

Eigen::Matrix3Xd FoundLoads::forces() const {
    if (!search) return {};
    const Eigen::VectorXd forces = search->kind->forces * coefficients;
    return Eigen::Map<const Eigen::Matrix3Xd>(forces.data(), 3, forces.size() / 3);
}

double difference_mm(const FoundLoads& a, const FoundLoads& b) {
    const Eigen::MatrixXd moved = a.search->fit.answers(a.coefficients - b.coefficients);
    return std::sqrt(3 * moved.squaredNorm() / double(moved.size()));
}

FoundLoads found_beside(const FoundLoads& acting, const Eigen::Matrix3Xd& displacement, double step) {
    const LoadSearch& search = *acting.search;
    const Eigen::VectorXd work =
        search.fit.work_without(acting.coefficients, search.kind->forces.transpose() * displacement.reshaped());
    const double size = search.fit.likeliest_size(work, search.expected);
    const Eigen::VectorXd next = search.fit.coefficients(work, size);
    return {size, acting.coefficients + step * (next - acting.coefficients), acting.search};
}

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

std::shared_ptr<const KindOfLoads> LoadFinder::shapes(LoadKind kind, const PreparedModel& model,
                                                      const WeighedSprings& unseen) {
    std::shared_ptr<const KindOfLoads>& shapes = shapes_[static_cast<std::size_t>(kind)];
    if (!shapes) {
        auto [fitted, applied] = loads(kind, model);
        LoadShapes known(std::move(fitted), Posterior(model, unseen), unseen.energy);
        Eigen::MatrixXd forces = known.scale() * applied;
        shapes = std::make_shared<const KindOfLoads>(KindOfLoads{std::move(known), std::move(forces)});
    }
    return shapes;
}

FoundLoads LoadFinder::found(LoadKind kind, const PreparedModel& model, const LastPulls& pulls) {
    auto of_kind = shapes(kind, model, without_data(pulls));
    SizePrior expected;
    if (kind == LoadKind::Bends)
        expected = {expected_bend_mm(model) / of_kind->known.deviation_mm(), bend_draws.log_deviation};
    const Posterior posterior(model, with_data(pulls));
    const bool followed = kind == LoadKind::Weight || &model == &prepared_;
    const auto search = std::make_shared<const LoadSearch>(std::move(of_kind), expected, posterior, followed);
    const Eigen::VectorXd work = search->fit.work(
        posterior.inverse(forces_of(pulls.of(Origin::Datum), 3 * Eigen::Index{model.rest.node_count})));
    const double size = search->fit.likeliest_size(work, expected);
    return {size, search->fit.coefficients(work, size), search};
}

}  // namespace tissuewarp::registration::detail
