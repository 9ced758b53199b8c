#pragma once
/// Loads that act on the tissue and that no registration knows: what they would do to the displacement.

#include "registration/prepare.hpp"

#include <Eigen/Core>

#include <cstdint>

namespace tissuewarp::registration::detail {

/// The loads that are drawn. Their kind and smoothness are part of the form of the error estimate, which was chosen on
/// the random phantoms 1–60 and 1001–1120 and is reported on 2001–2112 (docs/lab/accuracy-time.md).
struct LoadDraws {
    double smooth_over = 0.5;  ///< of the organ's radius, length over which tractions vary. Chosen there
};
inline constexpr LoadDraws load_draws{};

/// Random forces on the nodes, 3N × count, mN, in equilibrium: a uniform body force and tractions on the outer surface
/// that vary smoothly over half the organ's radius, of about 1 kPa. Only their shape tells; their size is arbitrary.
Eigen::MatrixXd unknown_loads(const PreparedModel& prepared, int count, std::uint64_t seed);

/// The same in the organ alone: body forces that vary as smoothly.
Eigen::MatrixXd unknown_body_forces(const PreparedModel& prepared, int count, std::uint64_t seed);

/// Unknown weight: the three uniform body forces of such loads, of variance 1 each, 3N × 3, mN.
Eigen::MatrixXd unknown_weights(const PreparedModel& prepared);

/// Root mean square distance of an organ's nodes from their middle, mm.
double radius_of(const Eigen::Matrix3Xd& nodes);

}  // namespace tissuewarp::registration::detail
