#pragma once
/// Steps that take what is rough off a residual: the smoother of methods with two levels.

#include "tled/stiffness/product.hpp"

namespace tissuewarp::tled::detail {

/// Largest λ of K x = λ D x by the power method from `start`, a tenth above what it finds; `divide` is by D.
double largest_eigenvalue(const Product& multiply, const Product& divide, Eigen::Matrix3Xd start);

/// A start for it, 3 × N: every wave length is in it.
Eigen::Matrix3Xd every_wave_length(Eigen::Index count);

/// Two Chebyshev steps for eigenvalues between a quarter and all of the largest one (Saad, Iterative Methods for Sparse
/// Linear Systems, algorithm 12.1): adds them to x, and takes their forces off the residual.
void chebyshev_steps(const Product& multiply, const Product& divide, double largest, Eigen::Matrix3Xd& x,
                     Eigen::Matrix3Xd& residual);

}  // namespace tissuewarp::tled::detail
