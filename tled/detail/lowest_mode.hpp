#pragma once
/// The slowest mode of K x = λ D x without a factor of K.

#include "tled/detail/product.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled::detail {

/// Smallest λ from above, within some per cent, for K symmetric and positive definite where nothing is constrained
/// (products are zero elsewhere) and D diagonal: that of `start`, zero where constrained and not everywhere, made
/// better by conjugate gradients for the Rayleigh quotient (Knyazev, SIAM J. Sci. Comput. 23 (2001) 517, algorithm 4.1)
/// until four of them gain less than 4 %. All arrays are 3 × N.
double lowest_mode(const Product& multiply_K, const Eigen::Matrix3Xd& D, const Eigen::Matrix3Xd& start);

}  // namespace tissuewarp::tled::detail
