// Dynamic relaxation: the explicit step of dynamics with free mass, damping and step size, run until static equilibrium
// (Underwood 1983; Joldes, Wittek, Miller 2011), checked by the lifted residual.

#include "tled/statics/heavy_ball.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

constexpr double slack = 0.85;      // part of the steps to the tolerance, by the decay of the slowest mode
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
        if (error > search_.options.tolerance_mm)
            spectrum_ = spectrum_at(search_, mass_, residual, search_.stiffness.lowest_eigenvalue());
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
            steps -= now;
            const std::optional<Matrix3Xd> u = search_.stepped(std::array{Steps{now, coefficients}});
            if (!u) {
                go_back(search_, ++restarts_);
                spectrum_ = shortened(
                    spectrum_at(search_, mass_, search_.residual(), search_.stiffness.lowest_eigenvalue()), restarts_);
                return false;
            }
            search_.keep(*u, error);
        }
        return true;
    }

    [[nodiscard]] int steps_to_reach(double error) const {
        constexpr double least = 25;        // a solve costs as much as some thirty of them
        constexpr double first_fall = 1.5;  // neper: beside loads K₀ overestimates the first error by far
        double fall = slack * std::log(error / search_.options.tolerance_mm);
        if (linear_start_) fall = std::min(fall, first_fall);
        return static_cast<int>(std::max(least, fall / decay(spectrum_)));
    }

    /// Where the present stiffness has slower modes than K₀ the error falls slower than foreseen.
    void adapt_damping(double before, double now, int steps) {
        if (steps < 50 || std::log(before / std::max(now, 1e-300)) > 0.4 * decay(spectrum_) * steps) return;
        spectrum_.lowest *= 0.6;
    }
};

}  // namespace

EquilibriumResult dynamic_relaxation(EquilibriumSearch& search, const Matrix3Xd* start) {
    return Relaxation(search).run(start);
}

}  // namespace tissuewarp::tled::detail
