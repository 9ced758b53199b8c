// Nonlinear conjugate gradients (Polak and Ribière 1969, with β ≥ 0: Nocedal and Wright, Numerical Optimization (2006),
// section 5.2), preconditioned with diag K₀. One force evaluation an iteration: the residual at the step's end is
// interpolated between its start and the trial point, which is exact for a linear model; every few iterations, and
// wherever the error is estimated, it is evaluated.

#include "tled/detail/equilibrium_search.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr int iterations_per_evaluation = 50;  // of the residual at the iterate
constexpr int least_iterations_per_lift = 20;
constexpr int most_idle_lifts = 4;  // without the error falling by a tenth
constexpr int most_restarts = 8;
constexpr double first_step = 0.3;  // of diag(K₀)⁻¹ r, whose spectrum ends near 8

double dot(const Matrix3Xd& a, const Matrix3Xd& b) {
    return a.cwiseProduct(b).sum();
}

class NonlinearCg {
public:
    explicit NonlinearCg(EquilibriumSearch& search)
        : search_(search), inverse_diagonal_(search.stiffness.diagonal(search.conditions).cwiseInverse()) {}

    EquilibriumResult run(const Matrix3Xd* start) {
        u_ = search_.begin(start);
        evaluate();
        double error = linear_start_safety * lift();
        double least = error, least_norm = std::sqrt(rz_);
        int idle = 0;
        for (int since_lift = 1, since_evaluation = 1; error > search_.options.tolerance_mm;
             ++since_lift, ++since_evaluation) {
            iterate();
            const bool promising = since_lift >= least_iterations_per_lift &&
                                   error_per_norm_ * std::sqrt(rz_) <= search_.options.tolerance_mm;
            if (!promising && since_evaluation < iterations_per_evaluation) continue;
            since_evaluation = 0;
            if (!evaluate()) continue;
            search_.keep(u_, error);
            const bool stuck = std::sqrt(rz_) > 0.9 * least_norm;
            least_norm = std::min(least_norm, std::sqrt(rz_));
            if (!promising && !stuck) continue;
            since_lift = 0;
            error = lift();
            idle = error < 0.9 * least ? 0 : idle + 1;
            least = std::min(least, error);
            if (idle > most_idle_lifts) search_.fail_stalled();
        }
        return search_.finish();
    }

private:
    EquilibriumSearch& search_;
    Matrix3Xd inverse_diagonal_, u_, r_, z_, p_;
    double rz_ = 0, step_ = first_step, error_per_norm_ = 0;
    int restarts_ = 0;

    /// The residual at the iterate, or at the last good one where this is inverted (false; p starts anew).
    bool evaluate() {
        const bool good = search_.admissible(u_);
        if (!good) {
            if (++restarts_ > most_restarts) search_.fail_stalled();
            u_ = search_.last_good();
            step_ *= 0.25;
            if (!search_.admissible(u_)) search_.fail_stalled();
        }
        r_ = search_.residual();
        if (z_.size() > 0 && good) return true;
        restart();
        return good;
    }

    void restart() {
        z_ = inverse_diagonal_.cwiseProduct(r_);
        rz_ = dot(r_, z_);
        p_ = z_;
    }

    double lift() {
        const double error = largest_norm(search_.lifted(r_));
        error_per_norm_ = error / std::max(std::sqrt(rz_), 1e-300);
        search_.keep(u_, error);
        return error;
    }

    void iterate() {
        constexpr int most_trials = 8;
        double slope = dot(r_, p_);
        if (!(slope > 0)) {
            p_ = z_;
            slope = rz_;
        }
        for (int trial = 0; trial < most_trials; ++trial) {
            if (!search_.admissible(u_ + step_ * p_)) {
                step_ *= 0.5;
                continue;
            }
            const Matrix3Xd there = search_.residual();
            const double fall = slope - dot(there, p_);
            const double best =
                fall > 1e-12 * slope ? std::clamp(step_ * slope / fall, 0.05 * step_, 4 * step_) : 4 * step_;
            if (best > 1.5 * step_ && trial + 1 < most_trials) {  // too far to extrapolate
                step_ = best;
                continue;
            }
            r_ += best / step_ * (there - r_);
            u_ += best * p_;
            step_ = best;
            turn();
            return;
        }
        search_.fail_stalled();
    }

    void turn() {
        const Matrix3Xd next = inverse_diagonal_.cwiseProduct(r_);
        const double next_rz = dot(r_, next), beta = std::max(0.0, (next_rz - dot(r_, z_)) / rz_);
        z_ = next;
        rz_ = next_rz;
        p_ = z_ + beta * p_;
    }
};

}  // namespace

EquilibriumResult nonlinear_cg(EquilibriumSearch& search, const Matrix3Xd* start) {
    return NonlinearCg(search).run(start);
}

}  // namespace tissuewarp::tled::detail
