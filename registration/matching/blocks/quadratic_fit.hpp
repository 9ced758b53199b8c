#pragma once
/// The parabola through the neighbourhood of a minimum on a lattice.

#include <Eigen/Core>

#include <array>
#include <optional>

namespace tissuewarp::registration::detail {

struct Quadratic {
    Eigen::Vector3d minimum;       ///< lattice steps from the centre, at most 1 along each principal axis
    Eigen::Matrix3d hessian;       ///< positive semidefinite, cost per lattice step²
    double largest_curvature = 0;  ///< eigenvalue of the hessian
};

/// Least-squares fit of c + gᵀx + ½ xᵀHx to the 27 costs about a lattice point (i fastest). Directions in which the
/// cost does not curve upwards, to 1 % of the largest curvature, take no part in the minimum. None when a cost is
/// infinite or nothing curves upwards.
std::optional<Quadratic> fit_quadratic(const std::array<double, 27>& costs);

}  // namespace tissuewarp::registration::detail
