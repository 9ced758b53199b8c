#include "tests/verification/limit.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace tissuewarp::verification {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;

namespace {

constexpr double lowest_believed = 0.5;

// Straight lines through the columns of y over x.
struct Lines {
    RowVectorXd at_zero, slope;
    MatrixXd residual;
    double variance_at_zero = 0;  // of at_zero, for values of variance 1

    Lines(const ArrayXd& x, const MatrixXd& y) {
        const Eigen::VectorXd centred = x - x.mean();
        slope = centred.transpose() * y / centred.squaredNorm();
        at_zero = y.colwise().mean() - x.mean() * slope;
        residual = (y - x.matrix() * slope).rowwise() - at_zero;
        variance_at_zero = 1.0 / static_cast<double>(x.size()) + x.mean() * x.mean() / centred.squaredNorm();
    }
};

struct Order {
    double value;
    bool within_scan;
};

// By a scan, then by thirds between the neighbours of its best.
Order best_order(const ArrayXd& h, const MatrixXd& u, double highest_scanned) {
    constexpr int steps = 400, refinements = 80;
    const double step = highest_scanned / steps;
    const auto squares = [&](double order) { return Lines(h.pow(order), u).residual.squaredNorm(); };
    int best = 1;
    double smallest = std::numeric_limits<double>::infinity();
    for (int k = 1; k <= steps; ++k) {
        const double found = squares(k * step);
        if (found >= smallest) continue;
        smallest = found;
        best = k;
    }
    if (best == 1 || best == steps) return {best * step, false};
    double low = (best - 1) * step, high = (best + 1) * step;
    for (int k = 0; k < refinements; ++k) {
        const double third = (high - low) / 3.0;
        if (squares(low + third) < squares(high - third)) {
            high -= third;
        } else {
            low += third;
        }
    }
    return {0.5 * (low + high), true};
}

}  // namespace

Limit limit_of(const std::vector<double>& cells, const std::vector<Eigen::VectorXd>& values, double highest_order) {
    if (cells.size() < 4 || values.size() != cells.size()) {
        throw InvalidInput("a limit with its error needs four meshes, not " + std::to_string(values.size()));
    }
    const auto meshes = static_cast<Eigen::Index>(cells.size()), numbers = values.front().size();
    const ArrayXd h = cells.back() / Eigen::Map<const ArrayXd>(cells.data(), meshes);
    MatrixXd u(meshes, numbers);
    for (Eigen::Index k = 0; k < meshes; ++k) u.row(k) = values[static_cast<std::size_t>(k)].transpose();

    const Order best = best_order(h, u, 2.0 * highest_order);
    const double order = std::clamp(best.value, lowest_believed, highest_order);
    const Lines fit(h.pow(order), u);
    double variance = fit.variance_at_zero, parameters = 2.0 * static_cast<double>(numbers);
    if (order == best.value) {  // ∂u/∂p = α hᵖ ln h, as far as u₀ and α cannot make up for it
        const Lines by_order(h.pow(order), (h.pow(order) * h.log()).matrix());
        variance += by_order.at_zero.squaredNorm() / (static_cast<double>(numbers) * by_order.residual.squaredNorm());
        parameters += 1.0;
    }
    const double freedom = static_cast<double>(u.size()) - parameters;
    return {fit.at_zero.transpose(), best.within_scan ? best.value : std::numeric_limits<double>::quiet_NaN(),
            std::sqrt(variance * fit.residual.squaredNorm() / freedom)};
}

}  // namespace tissuewarp::verification
