#pragma once
/// The slowest mode of K x = λ D x without a factor of K.

#include "tled/stiffness/product.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled::detail {

/// A mode and its λ.
struct Mode {
    double value = 0.0;
    Eigen::Matrix3Xd x;
};

/// A search ends where so many steps together gain less than a share.
struct Patience {
    int steps = 4;
    double least_gain = 0.04;
};

/// Smallest λ from above, within some per cent, for K symmetric and positive definite where nothing is constrained
/// (products are zero elsewhere) and D diagonal: that of `start`, zero where constrained and not everywhere, made
/// better by conjugate gradients for the Rayleigh quotient (Knyazev, SIAM J. Sci. Comput. 23 (2001) 517, algorithm 4.1)
/// as long as there is patience. All arrays are 3 × N.
Mode lowest_mode(const Product& multiply_K, const Eigen::Matrix3Xd& D, const Eigen::Matrix3Xd& start,
                 const Patience& patience = {});

}  // namespace tissuewarp::tled::detail
