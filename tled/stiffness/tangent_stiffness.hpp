#pragma once
/// The Hessian of the discrete energy as one sparse matrix.

#include "tled/rest_state.hpp"

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace tissuewarp::tled {

/// ∂²E/∂u² (3N × 3N, mN/mm, symmetric, both triangles stored), degree of freedom 3·node + component.
Eigen::SparseMatrix<double> tangent_stiffness(const RestState& rest, const Eigen::Matrix3Xd& displacement);

}  // namespace tissuewarp::tled
