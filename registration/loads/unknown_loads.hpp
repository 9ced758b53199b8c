#pragma once
/// Loads that act on the tissue and that no registration knows: what they would do to the displacement.

#include "registration/prepare.hpp"

#include <Eigen/Core>

#include <cstdint>

namespace tissuewarp::registration::detail {

/// The loads that are drawn. Their kind and smoothness are part of the form of the error estimate, which was chosen on
/// the random phantoms 1–60 and 1001–1120 and is reported on 2001–2112 (docs/lab/accuracy-time.md); registrations took them
/// over unchanged.
struct LoadDraws {
    double smooth_over = 0.5;  ///< of the organ's radius, length over which tractions vary. Chosen there
    int draws = 256;           ///< whose principal shapes are taken: those of the liver's surface did not depend on …
    std::uint64_t seed = 0x10ad5;  ///< … the seed. An error estimate draws others
};
inline constexpr LoadDraws load_draws{};

/// Random forces on the nodes, 3N × count, mN, in equilibrium: a uniform body force and tractions on the outer surface
/// that vary smoothly over half the organ's radius, of about 1 kPa. Only their shape tells; their size is arbitrary.
Eigen::MatrixXd unknown_loads(const PreparedModel& prepared, int count, std::uint64_t seed);

/// The same in the organ alone: body forces that vary as smoothly.
Eigen::MatrixXd unknown_body_forces(const PreparedModel& prepared, int count, std::uint64_t seed);

/// Unknown weight: the three uniform body forces of such loads, of variance 1 each, 3N × 3, mN.
Eigen::MatrixXd unknown_weights(const PreparedModel& prepared);

/// The principal shapes of such loads: with independent coefficients of variance 1 their sum is distributed as they
/// are, as nearly as so many shapes can be (Karhunen and Loève, of 256 draws).
struct PrincipalLoads {
    Eigen::MatrixXd loads;  ///< 3N × count, mN
    Eigen::MatrixXd axes;   ///< 256 × count: the shares of the draws in them
};
PrincipalLoads principal_loads(const PreparedModel& prepared, int count);

/// The same shapes on another mesh of the organ, 3N × count, mN. Shapes that are found on it anew would have other
/// signs and, where two are about as large, another order.
Eigen::MatrixXd loads_along(const PreparedModel& prepared, const Eigen::MatrixXd& axes);

}  // namespace tissuewarp::registration::detail
