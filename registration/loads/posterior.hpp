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
    std::vector<tled::Spring> placed_by = {};  ///< LastPulls::placed_by(): the ground moves along with these
};

/// Springs times displacements, 3N × k, mN.
Eigen::MatrixXd forces_of(const std::vector<tled::Spring>& springs, const Eigen::MatrixXd& displacements);

/// P = (Rᵀ W R)⁻¹ Rᵀ W, 6 × 3N, of motions R (3N × 6) and springs W: P u are the coefficients of the motion that comes
/// closest to u where the springs pull. A motion that they feel nothing of has none.
Eigen::MatrixXd rigid_part(const Eigen::MatrixXd& motions, const std::vector<tled::Spring>& weights);

/// Supports and prior of pulls alone.
WeighedSprings without_data(const LastPulls& pulls);
/// The same with the data.
WeighedSprings with_data(const LastPulls& pulls);

/// What is expected of an organ without data: springs G, which move along with the rigid motion R P u, in least
/// squares, of the nodes that springs W hold: P = rigid_part(R, W), R the six motions of the organ as a whole. P is
/// taken a little short, so that motions that no datum shows count as known to 100 mm.
class Prior {
public:
    /// At nodes of these places (3 × N, mm).
    Prior(const Eigen::Matrix3Xd& nodes, const WeighedSprings& springs);
    /// G (u − R P u), 3N × k, mN.
    [[nodiscard]] Eigen::MatrixXd forces(const Eigen::MatrixXd& displacements) const;
    /// G R, 3N × 6; 3N × 0 where the prior does not move.
    [[nodiscard]] const Eigen::MatrixXd& held() const { return held_; }
    /// P, 6 × 3N, or 0 × 3N.
    [[nodiscard]] const Eigen::MatrixXd& followed() const { return followed_; }

private:
    std::vector<tled::Spring> springs_;
    Eigen::MatrixXd held_, followed_;
};

/// exp(−Π/energy) is Gaussian for small displacements, of covariance energy · K⁻¹, K the stiffness at rest with all
/// springs (Bayes' rule with strain energy as the prior, e.g. Szeliski 1990) and a prior that may move along.
class Posterior {
public:
    /// Throws InvalidInput where the springs do not hold the tissue.
    Posterior(const PreparedModel& prepared, const WeighedSprings& springs);
    /// Of both, made at the same time.
    static std::pair<Posterior, Posterior> both(const PreparedModel& prepared, const WeighedSprings& first,
                                                const WeighedSprings& second);

    /// The inverse of K times forces, 3N × k, mN: displacements, mm.
    [[nodiscard]] Eigen::MatrixXd inverse(const Eigen::MatrixXd& forces) const;
    /// The same between some nodes, 3n × 3n: displacements of these under forces at them, mm/mN.
    [[nodiscard]] Eigen::MatrixXd inverse_between(const std::vector<int>& nodes) const;

    [[nodiscard]] const Prior& prior() const { return prior_; }
    /// K with a prior that stays, taken out.
    [[nodiscard]] tled::RestStiffness stiffness() && { return std::move(stiffness_); }

private:
    Posterior(const PreparedModel& prepared, const WeighedSprings& springs, tled::RestStiffness stiffness);

    tled::RestStiffness stiffness_;
    Prior prior_;
    // (K − H P)⁻¹ = K⁻¹ + K⁻¹ H (1 − P K⁻¹ H)⁻¹ P K⁻¹ with H = G R (Woodbury):
    Eigen::MatrixXd freed_;  // K⁻¹ H (1 − P K⁻¹ H)⁻¹, 3N × 6 or 3N × 0
};

}  // namespace tissuewarp::registration::detail
