#pragma once
/// The rigid motion that most of the matched points agree on.

#include <Eigen/Geometry>

namespace tissuewarp::registration::detail {

/// Chosen by hand; on which data is not recorded.
struct LeastTrimmedOptions {
    double kept_share = 0.7;  ///< of the points: what deformed does not turn the organ
    int concentrations = 10;  ///< steps at most
};
inline constexpr LeastTrimmedOptions least_trimmed_options{};

/// The rigid motion moving → fixed (3 × N each, mm) that minimises the sum of the smallest 70 % of the squared
/// residuals: least trimmed squares by concentration steps (Rousseeuw and Van Driessen 2006) from the fit to all, each
/// of them a fit by Umeyama 1991. Needs at least 10 points not on a line.
Eigen::Isometry3d least_trimmed_motion(const Eigen::Matrix3Xd& moving, const Eigen::Matrix3Xd& fixed);

}  // namespace tissuewarp::registration::detail
