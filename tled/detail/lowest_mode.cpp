#include "tled/detail/lowest_mode.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <utility>
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

/// xᵀ K x and xᵀ D x of directions.
struct InnerProducts {
    MatrixXd K, D;
};

/// In pieces that stay in the cache: large vectors are read once for all products.
InnerProducts inner_products(const std::vector<Direction>& directions, const Matrix3Xd& D) {
    constexpr Eigen::Index piece = 512;
    const auto count = static_cast<Eigen::Index>(directions.size());
    InnerProducts sum{MatrixXd::Zero(count, count), MatrixXd::Zero(count, count)};
    for (Eigen::Index first = 0; first < D.size(); first += piece) {
        const Eigen::Index size = std::min(piece, D.size() - first);
        const auto part = [&](const Matrix3Xd& x) { return Eigen::Map<const VectorXd>(x.data() + first, size); };
        for (Eigen::Index i = 0; i < count; ++i) {
            const VectorXd weighted = part(D).cwiseProduct(part(directions[i].x));
            for (Eigen::Index j = 0; j <= i; ++j) {
                sum.D(i, j) += weighted.dot(part(directions[j].x));
                sum.K(i, j) += part(directions[i].Kx).dot(part(directions[j].x));
            }
        }
    }
    sum.K = sum.K.selfadjointView<Eigen::Lower>();
    sum.D = sum.D.selfadjointView<Eigen::Lower>();
    return sum;
}

struct RitzPair {
    double value;
    VectorXd weights;  // of the directions, for a vector of length 1 in the inner product of D
};

/// The lowest in a span. What of it depends on the rest, to a millionth of its length, is left out.
RitzPair lowest_in(const InnerProducts& products) {
    constexpr double dependent = 1e-12;
    const VectorXd scale = products.D.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> span(scale.asDiagonal() * products.D * scale.asDiagonal());
    const Eigen::Index left_out = (span.eigenvalues().array() < dependent).count(), kept = scale.size() - left_out;
    const MatrixXd basis = scale.asDiagonal() * span.eigenvectors().rightCols(kept) *
                           span.eigenvalues().tail(kept).cwiseSqrt().cwiseInverse().asDiagonal();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> ritz(basis.transpose() * products.K * basis);
    return {ritz.eigenvalues()[0], basis * ritz.eigenvectors().col(0)};
}

Direction combined(const std::vector<Direction>& directions, const VectorXd& weights) {
    Direction sum{weights[0] * directions[0].x, weights[0] * directions[0].Kx};
    for (std::size_t k = 1; k < directions.size(); ++k) {
        sum.x += weights[static_cast<Eigen::Index>(k)] * directions[k].x;
        sum.Kx += weights[static_cast<Eigen::Index>(k)] * directions[k].Kx;
    }
    return sum;
}

}  // namespace

Mode lowest_mode(const Product& multiply_K, const Matrix3Xd& D, const Matrix3Xd& start, const Patience& patience) {
    constexpr int most_steps = 1000;
    std::vector<Direction> directions{{start, multiply_K(start)}};
    RitzPair lowest = lowest_in(inner_products(directions, D));
    Direction mode = combined(directions, lowest.weights), last;
    double before = lowest.value;
    for (int step = 1; step <= most_steps; ++step) {
        const Matrix3Xd downhill = mode.Kx.cwiseQuotient(D) - lowest.value * mode.x;
        if (downhill.isZero(0)) break;
        directions = {std::move(mode), {downhill, multiply_K(downhill)}};
        if (last.x.size() > 0 && !last.x.isZero(0)) directions.push_back(std::move(last));
        lowest = lowest_in(inner_products(directions, D));
        mode = combined(directions, lowest.weights);
        VectorXd onward = lowest.weights;
        onward[0] = 0;
        last = combined(directions, onward);
        if (step % patience.steps != 0) continue;
        if (lowest.value > (1 - patience.least_gain) * before) break;
        before = lowest.value;
    }
    return {lowest.value, std::move(mode.x)};
}

}  // namespace tissuewarp::tled::detail
