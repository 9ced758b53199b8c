#pragma once
/// Small operations on nodal vectors (3 × N).

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>
#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tissuewarp::tled::detail {

/// Largest Euclidean norm of a column.
inline double largest_norm(const Eigen::Matrix3Xd& vectors) {
    return std::sqrt(vectors.colwise().squaredNorm().maxCoeff());
}

/// Largest Euclidean distance between columns.
inline double largest_difference(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) {
    using Range = tbb::blocked_range<Eigen::Index>;
    const auto squared = [&](const Range& range, double most) {
        const auto difference = a.middleCols(range.begin(), range.size()) - b.middleCols(range.begin(), range.size());
        return std::max(most, difference.colwise().squaredNorm().maxCoeff());
    };
    const auto larger = [](double x, double y) { return std::max(x, y); };
    return std::sqrt(tbb::parallel_reduce(Range(0, a.cols(), 4096), 0.0, squared, larger));
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
