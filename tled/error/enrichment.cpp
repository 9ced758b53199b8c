#include "tled/error/enrichment.hpp"

#include "tled/model/springs.hpp"
#include "tled/parallel/parallel.hpp"
#include "tled/stiffness/chebyshev.hpp"
#include "tled/stiffness/dot.hpp"

#include <Eigen/LU>

#include <cmath>
#include <utility>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;

Enrichment::Enrichment(const HierarchicalTissue& tissue, const BubbleConditions& bubbles,
                       const NodalConditions& conditions, const RestStiffness& corners)
    : space_(tissue.space),
      bubbles_(bubbles),
      conditions_(conditions),
      corners_(corners),
      elastic_(tissue),
      inverse_block_(bubble_blocks(tissue)) {
    for (const auto& [edge, K] : bubbles.stiffness) inverse_block_[edge] += K;
    parallel_for(0, space_.edge_count(), [&](int edge) {
        Matrix3d& block = inverse_block_[edge];
        for (int c = 0; c < 3; ++c) {
            if (!bubbles.constrained(c, edge)) continue;
            block.row(c).setZero();
            block.col(c).setZero();
            block(c, c) = 1.0;
        }
        block = block.inverse().eval();
    });
    Matrix3Xd rough = every_wave_length(space_.size());
    rough.leftCols(space_.corner_count).setZero();
    constrain(rough);
    largest_ = largest_eigenvalue([this](const Matrix3Xd& x) { return multiply(x); },
                                  [this](const Matrix3Xd& x) { return divide_by_blocks(x); }, std::move(rough));
}

void Enrichment::constrain(Matrix3Xd& x) const {
    x.leftCols(space_.corner_count) = conditions_.constrained.select(0.0, x.leftCols(space_.corner_count));
    x.rightCols(space_.edge_count()) = bubbles_.constrained.select(0.0, x.rightCols(space_.edge_count()));
}

Matrix3Xd Enrichment::multiply(const Matrix3Xd& x) const {
    Matrix3Xd y = elastic_(x);
    add_spring_resistance(conditions_, x, y);
    for (const auto& [edge, K] : bubbles_.stiffness) {
        y.col(space_.corner_count + edge) += K * x.col(space_.corner_count + edge);
    }
    constrain(y);
    return y;
}

// Zero on the corners.
Matrix3Xd Enrichment::divide_by_blocks(const Matrix3Xd& residual) const {
    Matrix3Xd result(3, space_.size());
    result.leftCols(space_.corner_count).setZero();
    parallel_for(0, space_.edge_count(), [&](int edge) {
        const int i = space_.corner_count + edge;
        result.col(i) = inverse_block_[edge] * residual.col(i);
    });
    return result;
}

void Enrichment::smooth(Matrix3Xd& x, Matrix3Xd& residual) const {
    chebyshev_steps([this](const Matrix3Xd& y) { return multiply(y); },
                    [this](const Matrix3Xd& y) { return divide_by_blocks(y); }, largest_, x, residual);
}

Matrix3Xd Enrichment::precondition(Matrix3Xd& residual) const {
    Matrix3Xd z = Matrix3Xd::Zero(3, space_.size());
    smooth(z, residual);
    Matrix3Xd coarse = Matrix3Xd::Zero(3, space_.size());
    coarse.leftCols(space_.corner_count) = corners_.precondition(residual.leftCols(space_.corner_count));
    z += coarse;
    residual -= multiply(coarse);
    smooth(z, residual);
    return z;
}

// Saad, algorithm 9.1; K z is known from the preconditioner, and with it K p = K z + β K p. √(r·z) is about the energy
// norm of the error.
Enrichment::Solution Enrichment::solve(Matrix3Xd r, const DiscretisationOptions& options) const {
    constrain(r);
    Solution result{.x = Matrix3Xd::Zero(3, r.cols()), .failure = {}};
    Matrix3Xd left = r, p = precondition(left), Kp = r - left;
    double rz = dot(r, p);
    const double limit = options.relative_tolerance * options.relative_tolerance * rz;
    while (!(rz <= limit)) {
        if (result.iterations == options.max_iterations) {
            result.failure =
                "conjugate gradients did not converge in " + std::to_string(options.max_iterations) + " iterations";
            return result;
        }
        ++result.iterations;
        const double curvature = dot(p, Kp);
        if (!std::isfinite(curvature)) {
            result.failure = "loads or springs are not finite";
            return result;
        }
        if (!(curvature > 0.0)) {
            result.failure = "the tissue buckles between the nodes: its stiffness there is not positive";
            return result;
        }
        const double step = rz / curvature;
        result.x += step * p;
        r -= step * Kp;
        left = r;
        const Matrix3Xd z = precondition(left);
        const double next = dot(r, z), part = next / rz;
        p = z + part * p;
        Kp = (r - left) + part * Kp;
        rz = next;
    }
    return result;
}

}  // namespace tissuewarp::tled::detail
