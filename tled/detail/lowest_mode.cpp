#include "tled/detail/lowest_mode.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>
#include <vector>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// A vector with its product.
struct Direction {
    Matrix3Xd x, Kx;
};

double dot(const Matrix3Xd& a, const Matrix3Xd& b) {
    return a.cwiseProduct(b).sum();
}

/// In the inner product of D.
double dot(const Matrix3Xd& a, const Matrix3Xd& D, const Matrix3Xd& b) {
    return (a.array() * D.array() * b.array()).sum();
}

/// Directions of length 1 that are orthogonal in the inner product of D; those that depend on others are left out.
std::vector<Direction> orthonormal(std::vector<Direction> directions, const Matrix3Xd& D) {
    constexpr double dependent = 1e-6;
    std::vector<Direction> result;
    for (Direction& d : directions) {
        const double before = std::sqrt(dot(d.x, D, d.x));
        for (int pass = 0; pass < 2; ++pass)
            for (const Direction& other : result) {
                const double share = dot(other.x, D, d.x);
                d.x -= share * other.x;
                d.Kx -= share * other.Kx;
            }
        const double length = std::sqrt(dot(d.x, D, d.x));
        if (!(length > dependent * before)) continue;
        d.x /= length;
        d.Kx /= length;
        result.push_back(std::move(d));
    }
    return result;
}

struct RitzPair {
    double value;
    VectorXd weights;
};

/// The lowest in the span of orthonormal directions.
RitzPair lowest_in(const std::vector<Direction>& basis) {
    const auto size = static_cast<Eigen::Index>(basis.size());
    MatrixXd K(size, size);
    for (Eigen::Index i = 0; i < size; ++i)
        for (Eigen::Index j = 0; j <= i; ++j) K(i, j) = K(j, i) = dot(basis[i].x, basis[j].Kx);
    const Eigen::SelfAdjointEigenSolver<MatrixXd> ritz(K);
    return {ritz.eigenvalues()[0], ritz.eigenvectors().col(0)};
}

Direction combined(const std::vector<Direction>& basis, const VectorXd& weights) {
    Direction sum{weights[0] * basis[0].x, weights[0] * basis[0].Kx};
    for (std::size_t k = 1; k < basis.size(); ++k) {
        sum.x += weights[static_cast<Eigen::Index>(k)] * basis[k].x;
        sum.Kx += weights[static_cast<Eigen::Index>(k)] * basis[k].Kx;
    }
    return sum;
}

}  // namespace

double lowest_mode(const Product& multiply_K, const Matrix3Xd& D, const Matrix3Xd& start) {
    constexpr int most_steps = 1000, window = 4;
    constexpr double least_gain = 0.04;
    std::vector<Direction> basis = orthonormal({{start, multiply_K(start)}}, D);
    Direction mode = basis.front(), last;
    RitzPair lowest = lowest_in(basis);
    double before = lowest.value;
    for (int step = 1; step <= most_steps; ++step) {
        const Matrix3Xd downhill = mode.Kx.cwiseQuotient(D) - lowest.value * mode.x;
        std::vector<Direction> directions{mode, {downhill, multiply_K(downhill)}};
        if (last.x.size() > 0) directions.push_back(std::move(last));
        basis = orthonormal(std::move(directions), D);
        lowest = lowest_in(basis);
        mode = combined(basis, lowest.weights);
        VectorXd onward = lowest.weights;
        onward[0] = 0;
        last = combined(basis, onward);
        if (step % window != 0) continue;
        if (lowest.value > (1 - least_gain) * before) break;
        before = lowest.value;
    }
    return lowest.value;
}

}  // namespace tissuewarp::tled::detail
