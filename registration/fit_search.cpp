#include "registration/detail/fit_search.hpp"

#include "registration/terms/term.hpp"

#include <Eigen/LU>
#include <nlopt.hpp>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// ½ n log J + ½ ‖x‖²: the likelihood of n normal misfits of unknown variance, at its best variance J/n.
double FitSearch::cost(const VectorXd& x) {
    constexpr double of_failure = 1e3;
    observer_.checkpoint("parameter fit", std::min(1.0, double(evaluations_++) / most_evaluations_));
    try {
        const double ratio = std::max(1e-12, misfits(residuals(x)).sum() / given_by_block_.sum());
        return 0.5 * held_out_.block_count() * std::log(ratio) + 0.5 * x.squaredNorm();
    } catch (const SolverFailure&) {
        return of_failure + x.squaredNorm();  // tissue that finds no rest under these loads
    }
}

VectorXd FitSearch::minimise(const std::vector<std::size_t>& active) {
    struct Call {
        FitSearch& search;
        const std::vector<std::size_t>& active;
    } call{*this, active};
    const auto objective = [](unsigned, const double* values, double*, void* data) {
        const Call& self = *static_cast<Call*>(data);
        try {
            return self.search.cost(self.search.spread(self.active, values));
        } catch (...) {
            self.search.stopped_ = std::current_exception();
            throw nlopt::forced_stop();
        }
    };
    nlopt::opt optimiser(nlopt::LN_BOBYQA, unsigned(active.size()));
    optimiser.set_min_objective(objective, &call);
    std::vector<double> least, most, x(active.size(), 0.0);
    for (const std::size_t k : active) {
        least.push_back(scalars_[k].least);
        most.push_back(scalars_[k].most);
    }
    optimiser.set_lower_bounds(least);
    optimiser.set_upper_bounds(most);
    optimiser.set_initial_step(0.5);
    optimiser.set_xtol_abs(0.01);
    evaluations_ = 0;
    most_evaluations_ = 20 + 20 * int(active.size());
    optimiser.set_maxeval(most_evaluations_);
    double value = 0;
    try {
        optimiser.optimize(x, value);
    } catch (const nlopt::roundoff_limited&) {
        // The best point so far is in x: as good as this cost can be resolved.
    } catch (const nlopt::forced_stop&) {
        std::rethrow_exception(stopped_);
    }
    return spread(active, x.data());
}

namespace {

constexpr double derivative_step = 0.1;  // prior deviations

/// ∂ residuals / ∂ x_k by differences that stay within the bounds.
VectorXd derivative(FitSearch& search, const FitScalar& scalar, VectorXd x, Eigen::Index k) {
    const double at = x[k], above = std::min(scalar.most, at + derivative_step),
                 below = std::max(scalar.least, at - derivative_step);
    x[k] = above;
    const Eigen::Matrix3Xd high = search.residuals(x);
    x[k] = below;
    const Eigen::Matrix3Xd difference = (high - search.residuals(x)) / (above - below);
    return Eigen::Map<const VectorXd>(difference.data(), difference.size());
}

/// With the sensitivities S of the residuals r, the weights w of the blocks, φ the misfit per block, H = SᵀwS/φ and
/// G = Σ g gᵀ/φ² over the blocks' own slopes g = Sᵀwr, the estimate scatters by (H + 1)⁻¹ (G + 1) (H + 1)⁻¹ (Liang and
/// Zeger 1986; 1 is the prior): data of one block may err together, and by whatever size.
MatrixXd covariance(const FitSearch& search, const HeldOut& held_out, const MatrixXd& sensitivity,
                    const Eigen::Matrix3Xd& residuals) {
    const Eigen::Index count = sensitivity.cols();
    const int blocks = held_out.block_count();
    const double per_block = 2 * search.misfits(residuals).sum() / blocks;
    const VectorXd squared = search.squared(residuals);
    MatrixXd slopes = MatrixXd::Zero(count, blocks), curvature = MatrixXd::Zero(count, count);
    for (std::size_t s = 0; s < held_out.block_of().size(); ++s) {
        const int block = held_out.block_of()[s];
        const double weight = robust_weight(std::sqrt(squared[block]), search.scale_mm());
        const auto rows = sensitivity.middleRows<3>(3 * Eigen::Index(s));
        slopes.col(block) += weight * rows.transpose() * residuals.col(Eigen::Index(s));
        curvature += weight * rows.transpose() * rows;
    }
    const MatrixXd one = MatrixXd::Identity(count, count);
    const double few = double(blocks) / std::max<double>(1, double(blocks - count));
    const MatrixXd scatter = few * slopes * slopes.transpose() / (per_block * per_block);
    const MatrixXd inverse = (curvature / per_block + one).inverse();
    return inverse * (scatter + one) * inverse;
}

}  // namespace

FitEstimate estimate(FitSearch& search, const HeldOut& held_out, const std::vector<FitScalar>& scalars,
                     const std::vector<std::size_t>& active) {
    FitEstimate result;
    result.x = search.minimise(active);
    const Eigen::Matrix3Xd residuals = search.residuals(result.x);
    MatrixXd sensitivity(residuals.size(), Eigen::Index(active.size()));
    for (std::size_t k = 0; k < active.size(); ++k)
        sensitivity.col(Eigen::Index(k)) = derivative(search, scalars[active[k]], result.x, Eigen::Index(active[k]));
    result.covariance = covariance(search, held_out, sensitivity, residuals);
    const VectorXd after = search.misfits(residuals), gain = search.given_by_block() - after;
    const double scatter =
        std::sqrt(double(gain.size()) / double(gain.size() - 1)) * (gain.array() - gain.mean()).matrix().norm();
    result.misfit_ratio = after.sum() / search.given_by_block().sum();
    result.improvement = scatter > 0 ? gain.sum() / scatter : 0;
    return result;
}

}  // namespace tissuewarp::registration::detail
