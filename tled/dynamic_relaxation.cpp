// Dynamic relaxation: the explicit step of dynamics with free mass, damping and step size, run until static equilibrium
// (Underwood 1983; Joldes, Wittek, Miller 2011). With mass diag K₀ the step is the heavy-ball iteration on M⁻¹K, whose
// optimal coefficients follow from the extreme eigenvalues (Polyak 1964).

#include "tled/detail/equilibrium_search.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

struct Spectrum {
    double lowest = 0, highest = 0;  // of M⁻¹K
};

/// c = 4/(√λ_max + √λ_min)², ρ = ((√λ_max − √λ_min)/(√λ_max + √λ_min))².
StepCoefficients heavy_ball(const Spectrum& spectrum) {
    const double high = std::sqrt(spectrum.highest), low = std::sqrt(spectrum.lowest);
    const double ratio = (high - low) / (high + low);
    return {ratio * ratio, 4 / ((high + low) * (high + low))};
}

constexpr int lanczos_steps = 10;       // within 1 % of λ_max; power iteration takes 20 for 3 %
constexpr double step_safety = 1.05;    // on λ_max: Lanczos approaches from below, stiffness grows under load
constexpr double damping_factor = 1.4;  // on the lowest eigenvalue of K₀: the slowest mode carries little of the error
constexpr double slack = 0.85;          // part of the steps to the tolerance, by the decay of the slowest mode
constexpr int most_restarts = 6;
constexpr int most_idle_lifts = 6;  // without the error falling by a tenth

class Relaxation {
public:
    explicit Relaxation(EquilibriumSearch& search)
        : search_(search), mass_(search.stiffness.diagonal(search.conditions)) {
        search_.engine.set_mass(mass_);
    }

    EquilibriumResult run(const Matrix3Xd* start) {
        const Matrix3Xd u = search_.begin(start);
        if (!search_.admissible(u)) search_.fail_stalled();
        const Matrix3Xd residual = search_.residual();
        double error = linear_start_safety * largest_norm(search_.lifted(residual));
        search_.keep(u, error);
        if (error > search_.options.tolerance_mm) estimate_spectrum(residual);
        double least = error;
        for (int idle = 0; error > search_.options.tolerance_mm;) {
            const int steps = steps_to_reach(error);
            if (!relax(steps, error)) continue;
            const double now = largest_norm(search_.lifted(search_.residual()));
            adapt_damping(error, now, steps);
            error = now;
            linear_start_ = false;
            search_.keep(search_.engine.displacement(), error);
            idle = error < 0.9 * least ? 0 : idle + 1;
            least = std::min(least, error);
            if (idle > most_idle_lifts) search_.fail_stalled();
        }
        return search_.finish();
    }

private:
    EquilibriumSearch& search_;
    Matrix3Xd mass_;
    Spectrum spectrum_;
    int restarts_ = 0;
    bool linear_start_ = true;  // no step was made: the estimate of the error is that of K₀ alone

    /// Steps with a look at the state every few; false after a restart from the last good state.
    bool relax(int steps, double error) {
        const StepCoefficients coefficients = heavy_ball(spectrum_);
        while (steps > 0) {
            const int now = std::min(steps, std::max(1, search_.options.steps_per_check));
            search_.require_evaluations(now);
            search_.engine.run(now, coefficients);
            steps -= now;
            const Matrix3Xd u = search_.engine.displacement();
            const bool inverted = !(search_.engine.smallest_jacobian().value > 0);
            if (!u.allFinite() || (inverted && !search_.engine.admits_inversion())) {
                restart();
                return false;
            }
            search_.keep(u, error);
        }
        return true;
    }

    /// λ_max of M⁻¹K at the last good state, whose residual is given, by Lanczos' iteration (Golub and Van Loan,
    /// section 10.1) on M^(−½) K M^(−½), with products by differences of the real force kernel.
    void estimate_spectrum(const Matrix3Xd& residual) {
        const Matrix3Xd u = search_.last_good(), still = Matrix3Xd::Zero(3, u.cols());
        // Large enough to stand clear of round-off in u, small enough to stay near the tangent.
        const double amplitude = std::max(std::cbrt(search_.engine.precision()), 1e-3) * 0.3;
        const Matrix3Xd root = mass_.cwiseSqrt();
        Matrix3Xd q = search_.conditions.constrained.select(still, fixed_vector(u.cols())), previous = still;
        q /= q.norm();
        Eigen::MatrixXd T = Eigen::MatrixXd::Zero(lanczos_steps, lanczos_steps);
        double beta = 0;
        int size = 0;
        while (size < lanczos_steps) {
            const Matrix3Xd direction = q.cwiseQuotient(root);
            const double h = amplitude / largest_norm(direction);
            search_.engine.set_state(u + h * direction, still);
            Matrix3Xd w = ((residual - search_.residual()) / h).cwiseQuotient(root) - beta * previous;
            T(size, size) = w.cwiseProduct(q).sum();
            w -= T(size, size) * q;
            beta = w.norm();
            if (++size == lanczos_steps || !(beta > 1e-6 * T(0, 0))) break;
            T(size, size - 1) = T(size - 1, size) = beta;
            previous = q;
            q = w / beta;
        }
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(T.topLeftCorner(size, size), Eigen::EigenvaluesOnly);
        spectrum_.highest = step_safety * eigen.eigenvalues().maxCoeff();
        if (!(spectrum_.highest > 0)) search_.fail_stalled();
        spectrum_.lowest = std::min(damping_factor * search_.stiffness.lowest_eigenvalue(), spectrum_.highest / 4);
        search_.engine.set_state(u, still);
    }

    [[nodiscard]] double decay() const { return -0.5 * std::log(heavy_ball(spectrum_).momentum); }

    [[nodiscard]] int steps_to_reach(double error) const {
        constexpr double least = 25;        // a solve costs as much as some thirty of them
        constexpr double first_fall = 1.5;  // neper: beside loads K₀ overestimates the first error by far
        double fall = slack * std::log(error / search_.options.tolerance_mm);
        if (linear_start_) fall = std::min(fall, first_fall);
        return static_cast<int>(std::max(least, fall / decay()));
    }

    /// Where the present stiffness has slower modes than K₀ the error falls slower than foreseen.
    void adapt_damping(double before, double now, int steps) {
        if (steps < 50 || std::log(before / std::max(now, 1e-300)) > 0.4 * decay() * steps) return;
        spectrum_.lowest *= 0.6;
    }

    void restart() {
        if (++restarts_ > most_restarts) search_.fail_stalled();
        if (!search_.admissible(search_.last_good())) search_.fail_stalled();
        estimate_spectrum(search_.residual());
        spectrum_.highest *= 1 << restarts_;
        search_.observer.note("relaxation restarted from the last good state with a smaller step");
    }
};

}  // namespace

EquilibriumResult dynamic_relaxation(EquilibriumSearch& search, const Matrix3Xd* start) {
    return Relaxation(search).run(start);
}

}  // namespace tissuewarp::tled::detail
