#include "registration/loads/posterior.hpp"

#include "registration/pose/rigid_part.hpp"
#include "registration/springs/conditions.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

using Columns = Eigen::MatrixXd;  // 3N × k, nodes' vectors one after the other

tled::RestStiffness stiffness_with(const PreparedModel& prepared, const WeighedSprings& springs) {
    tled::Conditions all;
    all.springs = springs.data;
    all.springs.insert(all.springs.end(), springs.ground.begin(), springs.ground.end());
    return {prepared.rest, conditions_on(prepared, std::move(all)), prepared.stiffness};
}

double least_eigenvalue(const Columns& symmetric) {
    return Eigen::SelfAdjointEigenSolver<Columns>(symmetric, Eigen::EigenvaluesOnly).eigenvalues()[0];
}

}  // namespace

Eigen::MatrixXd forces_of(const std::vector<tled::Spring>& springs, const Eigen::MatrixXd& displacements) {
    Columns result = Columns::Zero(displacements.rows(), displacements.cols());
    for (const tled::Spring& spring : springs)
        result.middleRows<3>(3 * spring.node) += spring.stiffness * displacements.middleRows<3>(3 * spring.node);
    return result;
}

Eigen::MatrixXd rigid_part(const Eigen::MatrixXd& motions, const std::vector<tled::Spring>& weights) {
    const Columns weighed = forces_of(weights, motions);
    return (motions.transpose() * weighed).completeOrthogonalDecomposition().solve(weighed.transpose());
}

WeighedSprings without_data(const LastPulls& pulls) {
    return {pulls.of(Origin::Support), pulls.of(Origin::Prior), pulls.energy, pulls.placed_by()};
}

WeighedSprings with_data(const LastPulls& pulls) {
    WeighedSprings springs = without_data(pulls);
    const std::vector<tled::Spring> data = pulls.of(Origin::Datum);
    springs.data.insert(springs.data.end(), data.begin(), data.end());
    return springs;
}

Posterior::Posterior(const PreparedModel& prepared, const WeighedSprings& springs)
    : Posterior(prepared, springs, stiffness_with(prepared, springs)) {}

std::pair<Posterior, Posterior> Posterior::both(const PreparedModel& prepared, const WeighedSprings& first,
                                                const WeighedSprings& second) {
    tled::RestStiffness one = stiffness_with(prepared, first), other = stiffness_with(prepared, second);
    tled::factorise_together(one, other);
    return {Posterior(prepared, first, std::move(one)), Posterior(prepared, second, std::move(other))};
}

// Of a motion R c that no datum shows, what is left of the prior is (1 − s) cᵀ A c, A = Rᵀ G R: s so that it counts as
// known to 100 mm.
Prior::Prior(const Eigen::Matrix3Xd& nodes, const WeighedSprings& springs)
    : springs_(springs.ground), held_(nodes.size(), 0), followed_(0, nodes.size()) {
    if (springs.placed_by.empty() || springs_.empty()) return;
    const Columns motions = rigid_motions(nodes);
    held_ = forces_of(springs_, motions);
    const double known = posterior_options.least_known_mm,
                 left = springs.energy / (known * known * least_eigenvalue(motions.transpose() * held_));
    followed_ = (1 - std::min(1.0, left)) * rigid_part(motions, springs.placed_by);
}

Eigen::MatrixXd Prior::forces(const Eigen::MatrixXd& displacements) const {
    return forces_of(springs_, displacements) - held_ * (followed_ * displacements);
}

Posterior::Posterior(const PreparedModel& prepared, const WeighedSprings& springs, tled::RestStiffness stiffness)
    : stiffness_(std::move(stiffness)), prior_(prepared.model.mesh.nodes, springs), freed_(prior_.held()) {
    if (freed_.cols() == 0) return;
    const Columns held = stiffness_.solve_columns(freed_);
    const Columns middle = Columns::Identity(6, 6) - prior_.followed() * held;
    freed_ = held * middle.partialPivLu().inverse();
}

Eigen::MatrixXd Posterior::inverse(const Eigen::MatrixXd& forces) const {
    Columns result = stiffness_.solve_columns(forces);
    if (freed_.cols() > 0) result += freed_ * (prior_.followed() * result);
    return result;
}

// Rows of the freed motions, and by symmetry of K⁻¹ columns of P K⁻¹.
Eigen::MatrixXd Posterior::inverse_between(const std::vector<int>& nodes) const {
    Columns result = stiffness_.inverse_between(nodes);
    if (freed_.cols() == 0) return result;
    const Columns seen = stiffness_.solve_columns(prior_.followed().transpose());
    Columns freed_there(result.rows(), freed_.cols()), seen_there(result.rows(), freed_.cols());
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const auto row = static_cast<Eigen::Index>(3 * n);
        freed_there.middleRows<3>(row) = freed_.middleRows<3>(3 * nodes[n]);
        seen_there.middleRows<3>(row) = seen.middleRows<3>(3 * nodes[n]);
    }
    return result + freed_there * seen_there.transpose();
}

}  // namespace tissuewarp::registration::detail
