#include "tled/stiffness/lowest_mode.hpp"

#include "tled/parallel/parallel.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Eigen::Index piece = 512;  // entries, that stay in the cache: large vectors are read once for all they serve

/// visit(first, size, number) for the pieces of vectors, in all threads.
template <class Visit>
void for_each_piece(Eigen::Index entries, const Visit& visit) {
    const Eigen::Index pieces = (entries + piece - 1) / piece;
    parallel_ranges(0, static_cast<std::size_t>(pieces), 1, [&](std::size_t begin, std::size_t end) {
        for (auto number = static_cast<Eigen::Index>(begin); number < static_cast<Eigen::Index>(end); ++number)
            visit(number * piece, std::min(piece, entries - number * piece), number);
    });
}

auto part(const Matrix3Xd& x, Eigen::Index first, Eigen::Index size) {
    return Eigen::Map<const Eigen::ArrayXd>(x.data() + first, size);
}
auto part(Matrix3Xd& x, Eigen::Index first, Eigen::Index size) {
    return Eigen::Map<Eigen::ArrayXd>(x.data() + first, size);
}

/// A vector with its product.
struct Direction {
    Matrix3Xd x, Kx;
};
using Directions = std::array<Direction, 3>;

/// xᵀ K x and xᵀ D x of directions.
struct InnerProducts {
    MatrixXd K, D;
};

/// Of the first `count` directions; the same numbers for any number of threads.
InnerProducts inner_products(const Directions& directions, std::size_t count, const Matrix3Xd& D) {
    const auto size = static_cast<Eigen::Index>(count);
    Eigen::MatrixXd sums(2 * count * count, (D.size() + piece - 1) / piece);  // of each piece
    for_each_piece(D.size(), [&](Eigen::Index first, Eigen::Index entries, Eigen::Index number) {
        for (std::size_t i = 0, n = 0; i < count; ++i) {
            const Eigen::Array<double, Eigen::Dynamic, 1, 0, piece> weighted =
                part(D, first, entries) * part(directions[i].x, first, entries);
            for (std::size_t j = 0; j <= i; ++j) {
                const auto other = part(directions[j].x, first, entries);
                sums(n++, number) = (part(directions[i].Kx, first, entries) * other).sum();
                sums(n++, number) = (weighted * other).sum();
            }
        }
    });
    InnerProducts sum{MatrixXd::Zero(size, size), MatrixXd::Zero(size, size)};
    for (Eigen::Index i = 0, n = 0; i < size; ++i)
        for (Eigen::Index j = 0; j <= i; ++j) {
            sum.K(i, j) = sums.row(n++).sum();
            sum.D(i, j) = sums.row(n++).sum();
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

/// The mode takes its place and the way that led there that of the last; then downhill, without its product, is that of
/// the mode.
void advance(const RitzPair& lowest, const Matrix3Xd& D, Directions& directions) {
    auto& [mode, downhill, last] = directions;
    const double w0 = lowest.weights[0], w1 = lowest.weights[1],
                 w2 = lowest.weights.size() > 2 ? lowest.weights[2] : 0.0;
    for_each_piece(D.size(), [&](Eigen::Index first, Eigen::Index size, Eigen::Index) {
        const auto move = [&](Matrix3Xd& mode_part, const Matrix3Xd& downhill_part, Matrix3Xd& last_part) {
            auto way = part(last_part, first, size);
            way = w1 * part(downhill_part, first, size) + w2 * way;
            part(mode_part, first, size) = w0 * part(mode_part, first, size) + way;
        };
        move(mode.x, downhill.x, last.x);
        move(mode.Kx, downhill.Kx, last.Kx);
        part(downhill.x, first, size) =
            part(mode.Kx, first, size) / part(D, first, size) - lowest.value * part(mode.x, first, size);
    });
}

}  // namespace

Mode lowest_mode(const Product& multiply_K, const Matrix3Xd& D, const Matrix3Xd& start, const Patience& patience) {
    constexpr int most_steps = 1000;
    const Matrix3Xd zero = Matrix3Xd::Zero(3, D.cols());
    Directions directions{{{start, multiply_K(start)}, {zero, zero}, {zero, zero}}};
    auto& [mode, downhill, last] = directions;
    RitzPair lowest = lowest_in(inner_products(directions, 1, D));
    lowest.weights.conservativeResizeLike(VectorXd::Zero(2));
    double before = lowest.value;
    for (int step = 1; step <= most_steps; ++step) {
        advance(lowest, D, directions);
        const bool moved = !lowest.weights.tail(lowest.weights.size() - 1).isZero(0);
        downhill.Kx = multiply_K(downhill.x);
        const InnerProducts products = inner_products(directions, moved ? 3 : 2, D);
        if (products.D(1, 1) == 0) return {lowest.value, std::move(mode.x)};
        lowest = lowest_in(products);
        if (step % patience.steps != 0) continue;
        if (lowest.value > (1 - patience.least_gain) * before) break;
        before = lowest.value;
    }
    advance(lowest, D, directions);
    return {lowest.value, std::move(mode.x)};
}

}  // namespace tissuewarp::tled::detail
