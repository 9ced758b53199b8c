#pragma once
/// What a registration makes of organs whose motion is known, in linear elasticity: where it errs is where the true
/// place may lie.

#include "registration/loads/loaded_posterior.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace tissuewarp::registration::detail {

/// Motions that the organ may have had, and the loads that bring them about: (K + G) u = f, K the stiffness at rest and
/// G what is expected of the organ without any datum.
struct Truths {
    Eigen::MatrixXd displacement;  ///< u, 3N × k, mm
    Eigen::MatrixXd loads;         ///< f, 3N × k, mN
};

/// ε: errors of data, 3 × k of each, mm.
using DataErrors = std::vector<Eigen::MatrixXd>;

/// Of each datum independent noise, whose covariance is a share of what its pull admits, and what it shares with its
/// neighbours: a smooth field that varies over a centimetre. The same seed gives the same.
DataErrors drawn_errors(const std::vector<PulledNode>& data, const Eigen::Matrix3Xd& nodes, double energy, int count,
                        std::uint64_t seed);

/// û = S K_D (u + ε): the displacement that data K_D give of a true one, u. S is A⁻¹, A = K + G' + K_D, under the prior
/// G' of the registration; where it finds loads with it, see LoadedPosterior.
class LinearRegistration {
public:
    /// Of what pulled in the last round, and of all organs, of which nothing is known but what `unseen` expects: its
    /// springs are G. Also gives the posterior without data, made at the same time. Throws InvalidInput where the
    /// springs do not hold the tissue, SolverFailure without memory for the factors.
    static std::pair<LinearRegistration, Posterior> with_unseen(const PreparedModel& prepared, const LastPulls& pulls,
                                                                const LastPulls& unseen);

    /// The same registration, finding loads too.
    [[nodiscard]] LinearRegistration with_loads(KnownLoads loads) &&;

    /// u − û for data without errors, 3N × k, mm.
    [[nodiscard]] Eigen::MatrixXd missed(const Truths& truths) const;
    /// Displacements under forces: S f, 3N × k, mm.
    [[nodiscard]] Eigen::MatrixXd inverse(const Eigen::MatrixXd& forces) const { return posterior_.inverse(forces); }
    [[nodiscard]] const LoadedPosterior& posterior() const { return posterior_; }
    [[nodiscard]] tled::RestStiffness stiffness() && { return std::move(posterior_).unloaded().stiffness(); }

private:
    LinearRegistration(Posterior posterior, const PreparedModel& prepared, const LastPulls& pulls,
                       const LastPulls& unseen);

    LoadedPosterior posterior_;
    std::optional<Prior> expected_;  // G, where it is not the posterior's prior G'
};

/// K_D ε, 3N × k, mN, for N nodes.
Eigen::MatrixXd forces_of(const std::vector<PulledNode>& data, const DataErrors& errors, int nodes);

}  // namespace tissuewarp::registration::detail
