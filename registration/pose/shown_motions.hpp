#pragma once
/// How well data show the organ's motion as a whole: a ball's boundary does not tell how it turned, nor a straight
/// vessel how far the organ moved along it.

#include "registration/result.hpp"

#include <Eigen/Core>

#include <optional>

namespace tissuewarp::registration::detail {

/// Motions of the organ as a whole, and what springs feel of each.
struct ShownMotions {
    Eigen::Matrix<double, 6, 1> shares;  ///< ascending: uᵀ K u over tr K for u of mean square 1; ⅓ where springs of all
                                         ///< directions lie all over the organ, 0 for a motion that no datum shows
    Eigen::MatrixXd motions;  ///< 3N × 6, in the same order, orthogonal, each of mean square 1
};

/// Of the springs of data and supports, at nodes of these places (3 × N, mm). Precondition: some spring pulls.
ShownMotions shown_motions(const LastPulls& pulls, const Eigen::Matrix3Xd& nodes);

/// A motion with a smaller share counts as not shown. Chosen on the random patients 1 to 9 of the families *bent* and
/// *labelled*.
struct ShownMotionLimits {
    double least_share = 0.005;
};
inline constexpr ShownMotionLimits shown_motion_limits{};

/// In words, where the placement was sought and the data do not tell it; otherwise nothing.
std::optional<Doubt> doubt_of_placement(const LastPulls& pulls, const Eigen::Matrix3Xd& nodes);

}  // namespace tissuewarp::registration::detail
