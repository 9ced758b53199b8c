// Dynamic relaxation: the explicit step of dynamics with free mass, damping and step size, run until static equilibrium
// (Underwood 1983; Joldes, Wittek, Miller 2011). With mass diag K₀ the step is the heavy-ball iteration on M⁻¹K, whose
// optimal coefficients follow from the extreme eigenvalues (Polyak 1964).

#include "tled/equilibrium.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace tissuewarp::tled {

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

double largest_norm(const Eigen::Matrix3Xd& vectors) {
    return std::sqrt(vectors.colwise().squaredNorm().maxCoeff());
}

/// A fixed start vector with every frequency in it, so that repeated runs give the same bits.
Eigen::Matrix3Xd fixed_vector(Eigen::Index count) {
    Eigen::Matrix3Xd vector(3, count);
    std::uint32_t state = 1;
    for (double& x : vector.reshaped()) {
        state = 1664525u * state + 1013904223u;
        x = double(state) / 4294967296.0 - 0.5;
    }
    return vector;
}

/// Largest eigenvalue of M⁻¹K at the engine's displacement, by power iteration through the real force kernel. Leaves
/// the engine at that displacement with zero increment.
double highest_eigenvalue(Engine& engine, const Eigen::Matrix3Xd& mass, const Eigen::Matrix3Xd& u, int iterations) {
    const Eigen::Matrix3Xd rest = Eigen::Matrix3Xd::Zero(3, u.cols());
    engine.set_state(u, rest);
    const Eigen::Matrix3Xd residual = engine.residual();
    // Large enough to stand clear of round-off in u, small enough to stay near the tangent.
    const double amplitude = std::max(std::cbrt(engine.precision()), 1e-3) * 0.3;
    Eigen::Matrix3Xd direction = fixed_vector(u.cols());
    double eigenvalue = 0;
    for (int i = 0; i < iterations; ++i) {
        direction *= amplitude / largest_norm(direction);
        engine.set_state(u + direction, rest);
        const Eigen::Matrix3Xd moved = engine.displacement() - u;  // constrained nodes did not follow
        const Eigen::Matrix3Xd change = residual - engine.residual();
        const double denominator = (moved.array().square() * mass.array()).sum();
        eigenvalue = (moved.array() * change.array()).sum() / denominator;
        direction = change.cwiseQuotient(mass);
    }
    engine.set_state(u, rest);
    return eigenvalue;
}

constexpr int power_iterations = 20;
constexpr double least_starting_jacobian = 0.1;
constexpr double step_safety = 1.15;  // on λ_max: power iteration approaches from below, stiffness grows under load

class Relaxation {
public:
    Relaxation(Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions,
               const EquilibriumOptions& options, Observer& observer)
        : engine_(engine),
          stiffness_(stiffness),
          conditions_(conditions),
          options_(options),
          observer_(observer),
          mass_(stiffness.diagonal(conditions)),
          preset_(stiffness.lowest_eigenvalue()) {
        engine_.set_conditions(conditions);
        engine_.set_mass(mass_);
    }

    /// From rest: starts at the linear-elastic solution.
    EquilibriumResult run() {
        const Eigen::Matrix3Xd linear = stiffness_.linear_solution(conditions_);
        begin_from(Eigen::Matrix3Xd::Zero(3, linear.cols()), linear);
        return relax();
    }

    /// From a displacement: starts at it plus the linear-elastic answer to its residual.
    EquilibriumResult run(const Eigen::Matrix3Xd& start) {
        engine_.set_state(start, Eigen::Matrix3Xd::Zero(3, start.cols()));
        begin_from(start, lifted());
        return relax();
    }

private:
    EquilibriumResult relax() {
        double error = lifted_residual();
        const double first_error = std::max(error, options_.tolerance_mm);
        int steps_before_lifting = 0;
        while (!(error <= options_.tolerance_mm)) {
            require_steps_left(error);
            const int steps = std::max(1, options_.steps_per_check);
            engine_.run(steps, heavy_ball(spectrum_));
            result_.force_evaluations += steps;
            steps_before_lifting -= steps;
            const Observation seen = engine_.observe();
            result_.force_evaluations += 2;
            if (!trustworthy(seen)) {
                restart(seen);
                continue;
            }
            keep(seen);
            adapt_damping(seen);
            const double progress = std::log(first_error / std::max(error, options_.tolerance_mm)) /
                                    std::max(1e-9, std::log(first_error / options_.tolerance_mm));
            observer_.checkpoint("equilibrium", std::clamp(progress, 0.0, 1.0));
            if (steps_before_lifting > 0 || expected_error(seen) > options_.tolerance_mm) continue;
            error = lifted_residual();
            steps_before_lifting = steps_to_reach(error);
        }
        result_.displacement = engine_.displacement();
        result_.estimated_error_mm = error;
        const Observation last = engine_.observe();
        result_.min_jacobian = last.min_jacobian;
        if (!last.finite || last.min_jacobian <= 0)
            throw SolverFailure("equilibrium holds inverted tissue: det F = " + std::to_string(last.min_jacobian) +
                                " in tetrahedron " + std::to_string(last.min_jacobian_tet) +
                                "; use a finer mesh there or softer springs");
        return std::move(result_);
    }

    Engine& engine_;
    const RestStiffness& stiffness_;
    const NodalConditions& conditions_;
    const EquilibriumOptions& options_;
    Observer& observer_;
    Eigen::Matrix3Xd mass_;
    double preset_;  // lowest eigenvalue at rest
    Spectrum spectrum_;
    Eigen::Matrix3Xd good_;  // last state that was trustworthy
    double good_residual_ = 0;
    int restarts_ = 0;
    EquilibriumResult result_;

    /// Starts from `base` plus `correction`, or as much of it as leaves no element inverted: loads applied at once
    /// would tear the nodes next to them.
    void begin_from(const Eigen::Matrix3Xd& base, const Eigen::Matrix3Xd& correction) {
        const Eigen::Matrix3Xd still = Eigen::Matrix3Xd::Zero(3, base.cols());
        for (double part = 1; part > 0.01; part *= 0.7) {
            engine_.set_state(base + part * correction, still);
            const Observation seen = engine_.observe();
            result_.force_evaluations += 2;
            if (!seen.finite || seen.min_jacobian <= least_starting_jacobian) continue;
            good_ = engine_.displacement();
            good_residual_ = seen.residual_max;
            estimate_spectrum();
            return;
        }
        throw SolverFailure("no start for the equilibrium leaves every tetrahedron positive; apply the load in parts");
    }

    void estimate_spectrum() {
        spectrum_.highest = step_safety * highest_eigenvalue(engine_, mass_, good_, power_iterations);
        result_.force_evaluations += power_iterations + 1;
        spectrum_.lowest = std::min(preset_, spectrum_.highest / 4);
    }

    /// The lifted residual K₀⁻¹ r, mm: to first order the displacement still missing.
    Eigen::Matrix3Xd lifted() {
        ++result_.lifted_residuals;
        ++result_.force_evaluations;
        return stiffness_.solve(engine_.residual(), conditions_, 1e-2);
    }
    double lifted_residual() { return largest_norm(lifted()); }

    /// The motion decays by √ρ per step, so what remains is about the last increment over 1 − √ρ.
    [[nodiscard]] double expected_error(const Observation& seen) const {
        return seen.increment_max / (1 - std::sqrt(heavy_ball(spectrum_).momentum));
    }

    [[nodiscard]] int steps_to_reach(double error) const {
        const double decay = -0.5 * std::log(heavy_ball(spectrum_).momentum);
        return static_cast<int>(0.7 * std::log(std::max(1.0, error / options_.tolerance_mm)) / decay);
    }

    [[nodiscard]] bool trustworthy(const Observation& seen) const {
        return seen.finite && seen.min_jacobian > 0 && seen.residual_max < 50 * good_residual_ + 1e-6;
    }

    void keep(const Observation& seen) {
        good_ = engine_.displacement();
        good_residual_ = std::max(good_residual_ * 0.5, seen.residual_max);
    }

    /// Goes back to the last good state with the spectrum measured there and a smaller step.
    void restart(const Observation& seen) {
        if (++restarts_ > 6)
            throw SolverFailure("dynamic relaxation does not settle: det F = " + std::to_string(seen.min_jacobian) +
                                " in tetrahedron " + std::to_string(seen.min_jacobian_tet) + " after " +
                                std::to_string(result_.force_evaluations) +
                                " force evaluations; refine the mesh or lower the spring stiffness");
        estimate_spectrum();
        spectrum_.highest *= 1 << restarts_;
        observer_.note("relaxation restarted from the last good state with a smaller step");
    }

    /// Rayleigh quotient of the last step: as the fast modes die it falls to the lowest frequency of the present state.
    void adapt_damping(const Observation& seen) {
        if (!(seen.increment_mass > 0) || !(seen.increment_stiffness > 0)) return;
        const double quotient = seen.increment_stiffness / seen.increment_mass;
        spectrum_.lowest = std::clamp(quotient, 0.5 * preset_, std::min(4 * preset_, spectrum_.highest / 4));
    }

    void require_steps_left(double error) const {
        if (result_.force_evaluations < options_.max_steps) return;
        throw SolverFailure("equilibrium not reached in " + std::to_string(result_.force_evaluations) +
                            " force evaluations: estimated error " + std::to_string(error) + " mm, asked for " +
                            std::to_string(options_.tolerance_mm) + " mm; allow more steps or a larger tolerance");
    }
};

}  // namespace

EquilibriumResult equilibrium(Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions,
                              const EquilibriumOptions& options, const Eigen::Matrix3Xd* start, Observer& observer) {
    Relaxation relaxation(engine, stiffness, conditions, options, observer);
    return start ? relaxation.run(*start) : relaxation.run();
}

}  // namespace tissuewarp::tled
