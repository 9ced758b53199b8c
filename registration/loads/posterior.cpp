#include "registration/loads/posterior.hpp"

#include "registration/pose/rigid_part.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

using Columns = Eigen::MatrixXd;  // 3N × k, nodes' vectors one after the other

tled::RestStiffness stiffness_with(const PreparedModel& prepared, const WeighedSprings& springs) {
    tled::Conditions all;
    all.springs = springs.data;
    all.springs.insert(all.springs.end(), springs.ground.begin(), springs.ground.end());
    return {prepared.rest, tled::nodal_conditions(all, prepared.rest.node_count), prepared.stiffness};
}

Columns times(const std::vector<tled::Spring>& springs, const Columns& vectors) {
    Columns result = Columns::Zero(vectors.rows(), vectors.cols());
    for (const tled::Spring& spring : springs)
        result.middleRows<3>(3 * spring.node) += spring.stiffness * vectors.middleRows<3>(3 * spring.node);
    return result;
}

/// Of a symmetric matrix whose eigenvalues are to be no smaller than `least`.
Columns bounded_inverse(const Columns& matrix, double least) {
    const Eigen::SelfAdjointEigenSolver<Columns> modes(matrix);
    return modes.eigenvectors() * modes.eigenvalues().cwiseMax(least).cwiseInverse().asDiagonal() *
           modes.eigenvectors().transpose();
}

}  // namespace

WeighedSprings without_data(const LastPulls& pulls) {
    return {pulls.of(Origin::Support), pulls.of(Origin::Prior), pulls.energy, pulls.free_placement};
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

Posterior::Posterior(const PreparedModel& prepared, const WeighedSprings& springs, tled::RestStiffness stiffness)
    : stiffness_(std::move(stiffness)),
      freed_(3 * Eigen::Index(prepared.rest.node_count), 0) {
    if (!springs.free_placement) return;
    const Columns motions = rigid_motions(prepared.model.mesh.nodes), held = times(springs.ground, motions);
    freed_ = stiffness_.solve_columns(held);
    middle_ = bounded_inverse(motions.transpose() * held - held.transpose() * freed_,
                              springs.energy / (posterior_options.least_known_mm * posterior_options.least_known_mm));
}

Eigen::MatrixXd Posterior::inverse(const Eigen::MatrixXd& forces) const {
    Columns result = stiffness_.solve_columns(forces);
    if (freed_.cols() > 0) result += freed_ * (middle_ * (freed_.transpose() * forces));
    return result;
}

}  // namespace tissuewarp::registration::detail
