#pragma once
/// Bends of an organ that no registration knows, and the loads under which free tissue takes them.

#include "registration/prepare.hpp"

#include <Eigen/Core>

#include <cstdint>

namespace tissuewarp::registration::detail {

/// How an organ of which a part is seen is expected to bend. Chosen on `study coverage --problems organ:873-890`,
/// `bent:813-830` and `phantom:813-830` and on draws 1 to 48 of `surface_redraws_bench … --organs`
/// (docs/decisions/unknown_loads.md).
struct BendDraws {
    double smooth_over = 1;      ///< of the organ's radius, length over which displacements vary
    double of_radius = 0.08;     ///< deviation of the displacement, of the same, …
    double log_deviation = 0.5;  ///< … which is itself known to a factor of 2
    int waves = 20;              ///< of each bend. By hand
    int draws = 128;             ///< whose principal shapes are taken. By hand
    std::uint64_t seed = 0xbe4d;
};
inline constexpr BendDraws bend_draws{};

/// Loads, 3N × count, mN, under which free tissue is displaced by random fields that vary over an organ's radius and
/// conserve volume. Only their shape tells; their size is arbitrary.
Eigen::MatrixXd unknown_bends(const PreparedModel& prepared, int count, std::uint64_t seed);

/// The principal shapes of such bends: with independent coefficients of variance 1 their sum is distributed as they
/// are, as nearly as so many shapes can be (Karhunen and Loève, of the displacements).
struct PrincipalBends {
    Eigen::MatrixXd loads;  ///< 3N × count, mN
    Eigen::MatrixXd axes;   ///< draws × count: the shares of the draws in them
};
PrincipalBends principal_bends(const PreparedModel& prepared, int count);

/// The loads of the same shapes on another mesh of the organ, 3N × count, mN. Shapes that are found on it anew would
/// have other signs, or another order.
Eigen::MatrixXd bends_along(const PreparedModel& prepared, const Eigen::MatrixXd& axes);

/// Deviation of the displacement that is expected beforehand, mm.
double expected_bend_mm(const PreparedModel& prepared);

}  // namespace tissuewarp::registration::detail
