#pragma once
/// The smallest eigenvalue from solutions with the matrix.

#include <Eigen/Core>

#include <functional>

namespace tissuewarp::tled::detail {

/// Smallest λ of K x = λ D x for the diagonal D, by `solve`, which gives K⁻¹ of a vector: Lanczos steps on K⁻¹ D,
/// symmetric in the inner product of D, from a fixed vector without symmetry (Parlett, The Symmetric Eigenvalue Problem
/// (1998), section 13.2), with all directions made orthogonal again. The largest Ritz value errs by the square of its
/// vector's error.
double lowest_by_lanczos(const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& solve, const Eigen::VectorXd& D);

}  // namespace tissuewarp::tled::detail
