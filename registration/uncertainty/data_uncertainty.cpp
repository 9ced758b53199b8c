#include "registration/uncertainty/data_uncertainty.hpp"

#include "registration/loads/unknown_loads.hpp"
#include "registration/loads/white_noise.hpp"
#include "registration/pose/rigid_part.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/uncertainty/expected_error.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/stiffness/tangent_stiffness.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

using Covariances = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// xx, yy, zz, xy, xz, yz of every node's displacement over the samples (3N × k of mean 0).
Covariances covariances_of(const Eigen::MatrixXd& samples) {
    Covariances result(6, samples.rows() / 3);
    for (Eigen::Index n = 0; n < result.cols(); ++n) {
        const Eigen::Matrix<double, 3, Eigen::Dynamic> drawn = samples.middleRows<3>(3 * n);
        const Eigen::Matrix3d c = drawn * drawn.transpose() / double(samples.cols());
        result.col(n) << c(0, 0), c(1, 1), c(2, 2), c(0, 1), c(0, 2), c(1, 2);
    }
    return result;
}

/// Forces that the noise of the data exerts through its springs, 3N × count: of covariance energy · K.
Eigen::MatrixXd noise_forces(const WeighedSprings& springs, Eigen::Index rows, int count, std::uint64_t seed) {
    std::mt19937_64 generator(seed);
    Eigen::MatrixXd forces = Eigen::MatrixXd::Zero(rows, count);
    for (const tled::Spring& spring : springs.data) {
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spring.stiffness);
        const Eigen::Matrix3d root =
            axes.eigenvectors() * (springs.energy * axes.eigenvalues().cwiseMax(0)).cwiseSqrt().asDiagonal();
        forces.middleRows<3>(3 * spring.node) += root * white_noise(3, count, generator);
    }
    return forces;
}

/// Square of how large the unknown loads are, over those drawn: as large as the tissue was seen to strain, by strain
/// energy, where it would be seen to move as `visible` (3N × k, mm) under those drawn.
double load_size(const PreparedModel& prepared, double energy, const Eigen::Matrix3Xd& found,
                 const Eigen::MatrixXd& visible) {
    const auto stiffness = tled::tangent_stiffness(prepared.rest, Eigen::Matrix3Xd::Zero(3, found.cols()));
    const double drawn = 0.5 * visible.cwiseProduct(stiffness * visible).sum() / double(visible.cols());
    return (tled::elastic_energy(prepared.rest, found) + error_model.least_energy * energy) / drawn;
}

/// What part of the variance of bending under the loads drawn the data leave, at each node: of all motion left, or with
/// motions of the organ as a whole left out, which labels may leave open of a round one; the lesser of both.
Eigen::VectorXd unexplained_share(const Eigen::Matrix3Xd& nodes, const Eigen::MatrixXd& hidden,
                                  const Eigen::MatrixXd& free) {
    const Eigen::MatrixXd motions = rigid_motions(nodes);
    const Eigen::LDLT<Eigen::MatrixXd> squares(motions.transpose() * motions);
    const auto variance = [](const Eigen::MatrixXd& moved) {
        return Eigen::VectorXd(covariances_of(moved).topRows<3>().colwise().sum());
    };
    const auto bending = [&](const Eigen::MatrixXd& moved) {
        return Eigen::MatrixXd(moved - motions * squares.solve(motions.transpose() * moved));
    };
    return variance(hidden).cwiseMin(variance(bending(hidden))).cwiseQuotient(variance(bending(free)));
}

}  // namespace

Posteriors posteriors_of(const PreparedModel& prepared, const LastPulls& given) {
    LastPulls pulls = given;
    const auto is_prior = [](const PulledNode& pulled) { return pulled.origin == Origin::Prior; };
    if (std::none_of(pulls.springs.begin(), pulls.springs.end(),
                     is_prior))                                             // labels show where the organ lies, however
        expect_free_motion(pulls, prepared, TissuePrior().free_motion_mm);  // it turned
    WeighedSprings seen = with_data(pulls);
    auto [with, without] = Posterior::both(prepared, seen, without_data(pulls));
    return {std::move(seen), std::move(with), std::move(without), pulls.parts_alone};
}

DataUncertainty data_uncertainty(const PreparedModel& prepared, const Posteriors& posteriors,
                                 const Eigen::Matrix3Xd& displacement, int samples, std::uint64_t seed) {
    const WeighedSprings& springs = posteriors.springs;
    const Eigen::MatrixXd loads = unknown_loads(prepared, samples, seed);
    const Eigen::MatrixXd hidden = posteriors.seen.inverse(loads), free = posteriors.unseen.inverse(loads);
    const Eigen::MatrixXd noise = posteriors.seen.inverse(noise_forces(springs, loads.rows(), samples, seed + 1));
    DataUncertainty result;
    result.covariance = load_size(prepared, springs.energy, displacement, free - hidden) * covariances_of(hidden) +
                        error_model.noise_share * covariances_of(noise);
    result.unexplained = unexplained_share(prepared.model.mesh.nodes, hidden, free);
    if (posteriors.parts_alone) result.expected = expected_error(prepared.model.mesh.nodes, posteriors.seen);
    return result;
}

}  // namespace tissuewarp::registration::detail
