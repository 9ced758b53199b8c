#pragma once
/// What data and tissue leave open of a displacement.

#include "registration/prepare.hpp"
#include "registration/result.hpp"
#include "tled/conditions.hpp"

#include <Eigen/Core>

#include <utility>
#include <vector>

namespace tissuewarp::registration::detail {

struct PosteriorOptions {
    /// Motions of the organ as a whole that no datum shows, such as one along a straight vessel, are known no worse:
    /// their variance stays finite. Chosen by hand; on which data is not recorded.
    double least_known_mm = 100;
};
inline constexpr PosteriorOptions posterior_options{};

/// Springs of the data and of the prior, each weighed so that `energy` (mN mm) is one standard deviation.
struct WeighedSprings {
    std::vector<tled::Spring> data, ground;
    double energy = 1;
    bool free_placement = false;  ///< the organ may lie anywhere: the ground moves with it
};

/// Supports and prior of pulls alone.
WeighedSprings without_data(const LastPulls& pulls);
/// The same with the data.
WeighedSprings with_data(const LastPulls& pulls);

/// exp(−Π/energy) is Gaussian for small displacements, of covariance energy · K⁻¹, K the stiffness at rest with all
/// springs (Bayes' rule with strain energy as the prior, e.g. Szeliski 1990). Where the placement is free, the ground
/// G is G − G R (Rᵀ G R)⁻¹ Rᵀ G, R the six rigid motions: it holds no motion as a whole. Such motions that
/// the data do not show either are taken to be known to 100 mm.
class Posterior {
public:
    /// Throws InvalidInput where the springs do not hold the tissue.
    Posterior(const PreparedModel& prepared, const WeighedSprings& springs);
    /// Of both, made at the same time.
    static std::pair<Posterior, Posterior> both(const PreparedModel& prepared, const WeighedSprings& first,
                                                const WeighedSprings& second);

    /// The inverse of K times forces, 3N × k, mN: displacements, mm. Where
    /// the placement is free, the ground's hold on motions as a whole is taken out of K.
    [[nodiscard]] Eigen::MatrixXd inverse(const Eigen::MatrixXd& forces) const;

    /// K, taken out.
    [[nodiscard]] tled::RestStiffness stiffness() && { return std::move(stiffness_); }

private:
    Posterior(const PreparedModel& prepared, const WeighedSprings& springs, tled::RestStiffness stiffness);

    tled::RestStiffness stiffness_;
    // (K − G R A⁻¹ Rᵀ G)⁻¹ = K⁻¹ + K⁻¹ H (A − Hᵀ K⁻¹ H)⁻¹ Hᵀ K⁻¹ with H = G R, A = Rᵀ G R (Woodbury):
    Eigen::MatrixXd freed_;   // K⁻¹ H, 3N × 6, or 3N × 0 where the placement is not free
    Eigen::MatrixXd middle_;  // (A − Hᵀ K⁻¹ H)⁻¹
};

}  // namespace tissuewarp::registration::detail
