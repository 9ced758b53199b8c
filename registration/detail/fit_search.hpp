#pragma once
/// The values of tissue parameters with which data that do not pull are missed least, and how well the data tell them.

#include "registration/detail/held_out.hpp"

#include <exception>

namespace tissuewarp::registration::detail {

/// The search over scalars, of which some are held at their given values.
class FitSearch {
public:
    FitSearch(HeldOut& held_out, const std::vector<FitScalar>& scalars, Tissue given, double scale_mm,
              Observer& observer)
        : held_out_(held_out), scalars_(scalars), given_(std::move(given)), scale_mm_(scale_mm), observer_(observer) {
        given_by_block_ = misfits(residuals(Eigen::VectorXd::Zero(Eigen::Index(scalars.size()))));
    }

    /// Squared misfit of each block, mm².
    [[nodiscard]] Eigen::VectorXd squared(const Eigen::Matrix3Xd& residuals) const {
        Eigen::VectorXd sums = Eigen::VectorXd::Zero(held_out_.block_count());
        for (std::size_t s = 0; s < held_out_.block_of().size(); ++s)
            sums[held_out_.block_of()[s]] += residuals.col(Eigen::Index(s)).squaredNorm();
        return sums;
    }
    /// ½ s² d²/(s² + d²) of each block, mm²: support and other forces that no model knows act on some of them.
    [[nodiscard]] Eigen::VectorXd misfits(const Eigen::Matrix3Xd& residuals) const {
        const double s2 = scale_mm_ * scale_mm_;
        return squared(residuals).unaryExpr([s2](double d2) { return 0.5 * s2 * d2 / (s2 + d2); });
    }
    [[nodiscard]] const Eigen::VectorXd& given_by_block() const { return given_by_block_; }
    [[nodiscard]] double scale_mm() const { return scale_mm_; }
    [[nodiscard]] Tissue tissue(const Eigen::VectorXd& x) const {
        Tissue tissue = given_;
        for (std::size_t k = 0; k < scalars_.size(); ++k)
            if (x[Eigen::Index(k)] != 0) scalars_[k].apply(x[Eigen::Index(k)], tissue);
        return tissue;
    }
    [[nodiscard]] Eigen::Matrix3Xd residuals(const Eigen::VectorXd& x) {
        return held_out_.residuals(tissue(x), observer_);
    }

    /// The best values of the active scalars, the others at 0.
    Eigen::VectorXd minimise(const std::vector<std::size_t>& active);

private:
    HeldOut& held_out_;
    const std::vector<FitScalar>& scalars_;
    Tissue given_;
    double scale_mm_;
    Observer& observer_;
    Eigen::VectorXd given_by_block_;
    std::exception_ptr stopped_;
    int evaluations_ = 0, most_evaluations_ = 0;

    [[nodiscard]] Eigen::VectorXd spread(const std::vector<std::size_t>& active, const double* values) const {
        Eigen::VectorXd x = Eigen::VectorXd::Zero(Eigen::Index(scalars_.size()));
        for (std::size_t k = 0; k < active.size(); ++k) x[Eigen::Index(active[k])] = values[k];
        return x;
    }
    double cost(const Eigen::VectorXd& x);
};

/// Estimates of the active scalars with their covariance, in prior deviations.
struct FitEstimate {
    Eigen::VectorXd x;           // of all scalars
    Eigen::MatrixXd covariance;  // of the active ones
    double misfit_ratio = 1;     // of the held-out data, over that with the given values
    double improvement = 0;      // of this misfit, in deviations of its scatter over blocks
};

/// The estimate of the active scalars. Throws SolverFailure, Cancelled.
FitEstimate estimate(FitSearch& search, const HeldOut& held_out, const std::vector<FitScalar>& scalars,
                     const std::vector<std::size_t>& active);

}  // namespace tissuewarp::registration::detail
