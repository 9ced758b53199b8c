#pragma once
/// Preconditioned conjugate gradients (Saad, Iterative Methods for Sparse Linear Systems, algorithm 9.1).

#include "tled/stiffness/product.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled::detail {

/// How far conjugate gradients came.
struct ConjugateGradients {
    Eigen::Matrix3Xd x;  ///< 3 × N
    int iterations = 0;
    double relative_residual = 1.0;  ///< in the norm below
    bool positive = true;            ///< K along every direction that was taken
    Eigen::Matrix3Xd last;           ///< of them: where K is not positive along one, this one
};

/// x (3 × N) with K x = force by products with K. The error is measured in the norm of the preconditioner, √(r·z),
/// relative to its start. Force, products and what the preconditioner makes of them are zero on the constrained degrees
/// of freedom. Throws SolverFailure after 2000 iterations and where K is not positive.
Eigen::Matrix3Xd conjugate_gradients(const Product& product, const Product& precondition, const Eigen::Matrix3Xd& force,
                                     double relative_tolerance);

/// The same, which stops at the tolerance, after `most_iterations` and where K is not positive, as what it returns
/// says.
ConjugateGradients conjugate_gradients_within(int most_iterations, const Product& product, const Product& precondition,
                                              const Eigen::Matrix3Xd& force, double relative_tolerance);

}  // namespace tissuewarp::tled::detail
