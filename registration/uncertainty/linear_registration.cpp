#include "registration/uncertainty/linear_registration.hpp"

#include "registration/loads/smooth_field.hpp"
#include "registration/loads/white_noise.hpp"
#include "registration/uncertainty/error_model.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>

#include <memory>
#include <random>
#include <utility>

namespace tissuewarp::registration::detail {

using Eigen::MatrixXd;

namespace {

/// Roots of a share of the covariance energy · K⁻¹; 0 along directions in which a spring does not pull.
Eigen::Matrix3d noise_root(const Eigen::Matrix3d& stiffness, double energy) {
    constexpr double pulls_at_all = 1e-6;  // of the strongest direction
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(stiffness);
    Eigen::Vector3d deviations = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
        if (axes.eigenvalues()[k] > pulls_at_all * axes.eigenvalues()[2])
            deviations[k] = std::sqrt(error_model.noise_share * energy / axes.eigenvalues()[k]);
    return axes.eigenvectors() * deviations.asDiagonal();
}

}  // namespace

DataErrors drawn_errors(const std::vector<PulledNode>& data, const Eigen::Matrix3Xd& nodes, double energy, int count,
                        std::uint64_t seed) {
    std::mt19937_64 generator(seed);
    std::vector<SmoothField> shared;
    for (int k = 0; k < count; ++k) shared.emplace_back(error_model.shared_over_mm, generator);
    DataErrors errors;
    for (std::size_t n = 0; n < data.size(); ++n) errors.push_back(white_noise(3, count, generator));
    tbb::parallel_for(std::size_t{0}, data.size(), [&](std::size_t n) {
        const tled::Spring& spring = data[n].spring;
        errors[n] = noise_root(spring.stiffness, energy) * errors[n];
        for (int k = 0; k < count; ++k)
            errors[n].col(k) += data[n].shared_mm * shared[std::size_t(k)](nodes.col(spring.node));
    });
    return errors;
}

MatrixXd forces_of(const std::vector<PulledNode>& data, const DataErrors& errors, int nodes) {
    MatrixXd result = MatrixXd::Zero(3 * Eigen::Index{nodes}, errors.empty() ? 0 : errors.front().cols());
    for (std::size_t n = 0; n < data.size(); ++n)
        result.middleRows<3>(3 * data[n].spring.node) += data[n].spring.stiffness * errors[n];
    return result;
}

LinearRegistration::LinearRegistration(Posterior posterior, const PreparedModel& prepared, const LastPulls& pulls,
                                       const LastPulls& unseen)
    : posterior_(LoadedPosterior(std::move(posterior))) {
    if (pulls.prior_moves == PriorMoves::WithSurface) return;  // one and the same
    expected_.emplace(prepared.model.mesh.nodes, without_data(unseen));
}

std::pair<LinearRegistration, Posterior> LinearRegistration::with_unseen(const PreparedModel& prepared,
                                                                         const LastPulls& pulls,
                                                                         const LastPulls& unseen) {
    auto [seen, without] = Posterior::both(prepared, with_data(pulls), without_data(unseen));
    return {LinearRegistration(std::move(seen), prepared, pulls, unseen), std::move(without)};
}

LinearRegistration LinearRegistration::with_loads(KnownLoads loads) && {
    LinearRegistration result = std::move(*this);
    result.posterior_ =
        LoadedPosterior(std::move(result.posterior_).unloaded(), std::make_shared<const KnownLoads>(std::move(loads)));
    return result;
}

// Without loads A (u − û) = (K + G') u = f + (G' − G) u =: r; with them û gains what is found of A⁻¹ K_D u = u − A⁻¹ r.
MatrixXd LinearRegistration::missed(const Truths& truths) const {
    const MatrixXd& u = truths.displacement;
    const Posterior& unloaded = posterior_.unloaded();
    const MatrixXd missed = unloaded.inverse(
        expected_ ? MatrixXd(truths.loads + unloaded.prior().forces(u) - expected_->forces(u)) : truths.loads);
    return missed - posterior_.of_loads(u - missed);
}

}  // namespace tissuewarp::registration::detail
