#pragma once
/// Small operations on nodal vectors (3 × N).

#include <Eigen/Core>

#include <cmath>
#include <cstdint>

namespace tissuewarp::tled::detail {

/// Largest Euclidean norm of a column.
inline double largest_norm(const Eigen::Matrix3Xd& vectors) {
    return std::sqrt(vectors.colwise().squaredNorm().maxCoeff());
}

/// A fixed start for eigenvalue iterations with every frequency in it, so that repeated runs give the same bits.
inline Eigen::Matrix3Xd fixed_vector(Eigen::Index count) {
    Eigen::Matrix3Xd vector(3, count);
    std::uint32_t state = 1;
    for (double& x : vector.reshaped()) {
        state = 1664525u * state + 1013904223u;
        x = state / 4294967296.0 - 0.5;
    }
    return vector;
}

}  // namespace tissuewarp::tled::detail
