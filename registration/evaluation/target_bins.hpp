#pragma once
/// Errors by where the target lies: deep in the organ or near its surface, near the data or far from them.

#include "registration/evaluation.hpp"

#include <vector>

namespace tissuewarp::registration {

/// Errors of the targets whose coordinate lies in [from, to).
struct ErrorBin {
    double from = 0, to = 0;  ///< mm; −∞ and ∞ at the ends
    Summary error;            ///< count 0 where no target lies
};

/// Errors (mm) by a coordinate of their targets (mm), in the bins (−∞, 0), [0, edges₀), [edges₀, edges₁) … [last, ∞),
/// the first only where a coordinate is negative. Throws InvalidInput unless there is one coordinate per error, none
/// NaN, and the edges are positive and ascending.
std::vector<ErrorBin> bin_errors(const Eigen::VectorXd& errors, const Eigen::VectorXd& coordinates,
                                 const std::vector<double>& edges);

/// Depth (mm) of points (3 × P, LPS mm) below the surface of the organ, the union of all labels: the trilinear signed
/// distance to the boundary of the label map, negative outside, −∞ beyond the image. A face of the organ that the
/// image's border cuts is no surface. Throws InvalidInput when the map is empty or full.
Eigen::VectorXd depth_below_surface(const imaging::Volume& labels, const Eigen::Matrix3Xd& points);

/// Distance (mm) from points to the nearest datum, both 3 × N, LPS mm, one frame. Throws InvalidInput without a datum.
Eigen::VectorXd distance_to_data(const Eigen::Matrix3Xd& points, const Eigen::Matrix3Xd& data);

}  // namespace tissuewarp::registration
