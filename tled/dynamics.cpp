// The central-difference step in increment form, v = u − u⁻ of the engine: v⁺ = ρ v + c M⁻¹ r with
// c = Δt²/(1 + αΔt/2), ρ = (1 − αΔt/2)/(1 + αΔt/2) (Miller et al. 2007, eq. 17).

#include "tled/dynamics.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "core/errors.hpp"
#include "tled/critical_step.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/model/springs.hpp"

namespace tissuewarp::tled {

using Eigen::Matrix3Xd;

namespace {

constexpr int first_iterations = 40, later_iterations = 5, most_cuts = 6;
constexpr double cutting_margin = 0.97;  // of the critical step: above, the step is cut
constexpr double loose_tolerance = 1.0;
constexpr double fewest_held = 10;  // steps between two changes of the conditions

/// Whether something may give energy back or do work that no potential tells: viscous tissue, a pressure on a surface
/// with a moving rim, an obstacle that moves, a step over the kink of a spring to one side.
bool energy_may_grow(const RestState& rest, const NodalEffects& effects) {
    return !rest.viscosity.empty() || effects.contact || effects.surface.pressure.size() > 0 ||
           !effects.surface.parting.empty();
}

class Run {
public:
    Run(Engine& engine, const RestState& rest, const Matrix3Xd& mass, const ChangingConditions& conditions,
        const DynamicsState& start, double duration, const DynamicsOptions& options, Observer& observer)
        : engine_(engine),
          rest_(rest),
          mass_(mass),
          changing_(conditions),
          options_(options),
          observer_(observer),
          tolerance_(options.energy_tolerance),
          start_time_(start.time),
          end_time_(start.time + duration) {
        engine_.set_mass(mass);
        apply(start.time);
        if (energy_may_grow(rest_, conditions_->effects)) tolerance_ = loose_tolerance;
        choose_step(start.displacement);
        begin(start);
    }

    DynamicsResult run() {
        while (end_time_ - result_.state.time > 1e-9 * result_.step) {
            const double left = next_stop() - result_.state.time;
            const int steps =
                static_cast<int>(std::min<double>(options_.steps_per_check, std::ceil(left / result_.step - 1e-9)));
            if (steps * result_.step > left) change_step(left / steps);
            take(steps);
            result_.steps += steps;
            accept_or_cut(steps);
        }
        return std::move(result_);
    }

private:
    [[nodiscard]] StepCoefficients coefficients() const {
        const double half = 0.5 * options_.damping * result_.step;
        return {(1 - half) / (1 + half), result_.step * result_.step / (1 + half), result_.step};
    }

    void apply(double time) {
        conditions_ = &changing_.at(time);
        applied_ = detail::applied_force(*conditions_);
        engine_.set_conditions(*conditions_);
    }

    [[nodiscard]] double next_stop() const {
        const double now = result_.state.time + 1e-9 * result_.step;
        const auto stop = std::upper_bound(options_.stops.begin(), options_.stops.end(), now);
        return stop == options_.stops.end() ? end_time_ : std::min(*stop, end_time_);
    }

    /// Steps of the present length, under conditions that change now and then.
    void take(int steps) {
        if (!(changing_.interval > 0)) return engine_.run(steps, coefficients());
        const double held = std::max<double>(fewest_held, std::floor(changing_.interval / result_.step));
        const int parts = std::max(1, static_cast<int>(std::ceil(steps / held)));
        for (int part = 0, done = 0; part < parts; ++part) {
            const int next = static_cast<int>(std::int64_t{steps} * (part + 1) / parts);
            apply(result_.state.time + next * result_.step);
            if (part + 1 == parts) {
                // A body that has moved puts nodes onto its surface in the first step: that is work, not growth.
                engine_.run(1, coefficients());
                first_total_ = total_energy(engine_.observe()).total;
                ++done;
            }
            engine_.run(next - done, coefficients());
            done = next;
        }
    }

    /// Which of the pairs that may part press in a mode is not known beforehand: all are held together for it, which
    /// is stiffest.
    HighestMode stiffest_mode(const Matrix3Xd& displacement, int iterations, const Matrix3Xd* start = nullptr) {
        const SurfaceEffects& surface = conditions_->effects.surface;
        if (surface.parting.empty()) return highest_mode(engine_, mass_, displacement, iterations, start);
        NodalConditions closed = *conditions_;
        closed.effects.surface = with_pairs_decided(surface, std::vector<bool>(surface.parting.size(), true));
        engine_.set_conditions(closed);
        HighestMode mode = highest_mode(engine_, mass_, displacement, iterations, start);
        engine_.set_conditions(*conditions_);
        return mode;
    }

    /// s, 2/ω; with pairs that may part half of it. A node comes to a spring to one side with the increment −v and
    /// leaves it with (ω Δt)² v − v where it has gone deepest. A bar that bounces for 2.4 s gained 3 % of its energy at
    /// 1/ω and 30 % at 1.4/ω, and flew away at 1.6/ω.
    [[nodiscard]] double critical_step_of(const HighestMode& mode) const {
        const bool to_one_side = !conditions_->effects.surface.parting.empty();
        return (to_one_side ? 1 : 2) / std::sqrt(mode.eigenvalue);
    }

    void choose_step(const Matrix3Xd& displacement) {
        HighestMode mode = stiffest_mode(displacement, first_iterations);
        mode_ = std::move(mode.shape);
        result_.critical_step = mode.eigenvalue > 0 ? critical_step_of(mode) : end_time_ - start_time_;
        if (!std::isfinite(result_.critical_step))
            throw SolverFailure("the start of the dynamics has forces that are not finite: no step is stable there");
        if (options_.step > result_.critical_step)
            throw InvalidInput("the time step of " + std::to_string(1e6 * options_.step) +
                               " us is above the critical one, " + std::to_string(1e6 * result_.critical_step) +
                               " us: take a smaller step, a coarser mesh or mass scaling");
        result_.step = options_.step > 0 ? options_.step : options_.safety * result_.critical_step;
    }

    /// u − u⁻ = Δt v − Δt²/2 a, so that the first step has second order.
    void begin(const DynamicsState& start) {
        engine_.set_state(start.displacement, Matrix3Xd::Zero(3, rest_.node_count));
        const Matrix3Xd acceleration = engine_.residual().cwiseQuotient(mass_) - options_.damping * start.velocity;
        engine_.set_increment(result_.step * start.velocity - 0.5 * result_.step * result_.step * acceleration);
        result_.state = {engine_.displacement(), start.velocity, start.time};
        first_total_ = total_energy(engine_.observe()).total;
        engine_.keep_state();
    }

    /// The same motion in steps of another length: v(t − Δt'/2) = v(t) − Δt'/2 a. The energy of the discrete model
    /// depends on the step, that of fast modes strongly; its growth is counted from the new value.
    void change_step(double step) {
        const double before = total_energy(engine_.observe()).total;
        const Matrix3Xd half_velocity = engine_.increment() / result_.step;
        const Matrix3Xd acceleration = engine_.residual().cwiseQuotient(mass_) - options_.damping * half_velocity;
        engine_.set_increment(step * (half_velocity + 0.5 * (result_.step - step) * acceleration));
        result_.step = step;
        first_total_ += total_energy(engine_.observe()).total - before;
        engine_.keep_state();
    }

    [[nodiscard]] double potential(const Matrix3Xd& u) const {
        Matrix3Xd resistance = Matrix3Xd::Zero(3, u.cols());
        detail::add_spring_resistance(*conditions_, u, resistance);
        return elastic_energy(rest_, u) + u.cwiseProduct(0.5 * resistance - applied_).sum() +
               energy(conditions_->effects, rest_.position, u);
    }

    [[nodiscard]] EnergyBalance total_energy(const Observation& seen) {
        EnergyBalance balance;
        const Matrix3Xd u = engine_.displacement();
        balance.kinetic = 0.5 * seen.increment_mass / (result_.step * result_.step);
        balance.potential = potential(u);
        balance.total = balance.kinetic + 0.5 * (balance.potential + potential(u - engine_.increment())) -
                        0.25 * seen.increment_stiffness;
        exchanged_ = std::max({exchanged_, balance.kinetic, std::abs(balance.potential)});
        if (exchanged_ > 0) balance.largest_growth = (balance.total - first_total_) / exchanged_;
        return balance;
    }

    void accept_or_cut(int steps) {
        const Observation seen = engine_.observe();
        const std::string trouble = trouble_of(seen);
        if (!trouble.empty()) return cut(trouble, steps);
        const EnergyBalance balance = total_energy(seen);
        if (!(balance.largest_growth <= tolerance_))
            return cut("energy grew by " + std::to_string(100 * balance.largest_growth) + " %", steps);
        const double growth = std::max(result_.energy.largest_growth, balance.largest_growth);
        result_.energy = balance;
        result_.energy.largest_growth = growth;
        result_.min_jacobian = std::min(result_.min_jacobian, seen.min_jacobian);
        result_.state.time += steps * result_.step;
        result_.state.displacement = engine_.displacement();
        const Matrix3Xd half_velocity = engine_.increment() / result_.step;
        result_.state.velocity =
            half_velocity +
            0.5 * result_.step * (engine_.residual().cwiseQuotient(mass_) - options_.damping * half_velocity);
        engine_.keep_state();
        if (options_.watch) options_.watch(result_.state, result_.energy);
        observer_.checkpoint("dynamics", (result_.state.time - start_time_) / (end_time_ - start_time_));
        if (end_time_ - result_.state.time > 1e-9 * result_.step) follow_critical_step();
    }

    [[nodiscard]] std::string trouble_of(const Observation& seen) const {
        if (!seen.finite) return "a displacement or force is not finite";
        if (seen.min_jacobian > 0) return {};
        if (engine_.admits_inversion()) return {};
        return "tetrahedron " + std::to_string(seen.min_jacobian_tet) +
               " has det F = " + std::to_string(seen.min_jacobian);
    }

    /// Goes back to the last good state with half the step.
    void cut(const std::string& trouble, int steps) {
        engine_.return_to_kept_state();
        result_.steps -= steps;
        if (++result_.cuts > most_cuts)
            throw SolverFailure("dynamics stopped after t = " + std::to_string(result_.state.time) + " s: " + trouble +
                                " within " + std::to_string(steps) + " steps of " + std::to_string(1e6 * result_.step) +
                                " us, and smaller steps did not help; apply the load more slowly or refine the mesh");
        observer_.note(trouble + ": going back to t = " + std::to_string(result_.state.time) +
                       " s with half the time step");
        change_step(0.5 * result_.step);
    }

    /// Stiffness grows under load: a few iterations from the last highest mode, mixed with every other frequency.
    void follow_critical_step() {
        Matrix3Xd start = mode_;
        for (Eigen::Index i = 0; i < start.size(); ++i)
            start.reshaped()[i] += 0.02 * std::sin(1.7 * static_cast<double>(i) + 0.3);
        HighestMode mode = stiffest_mode(result_.state.displacement, later_iterations, &start);
        engine_.return_to_kept_state();
        mode_ = std::move(mode.shape);
        if (!(mode.eigenvalue > 0)) return;
        const double critical = critical_step_of(mode);
        result_.critical_step = std::min(result_.critical_step, critical);
        if (result_.step <= cutting_margin * critical) return;
        observer_.note("tissue stiffened: the time step is cut to " + std::to_string(1e6 * options_.safety * critical) +
                       " us");
        ++result_.cuts;
        change_step(options_.safety * critical);
    }

    Engine& engine_;
    const RestState& rest_;
    const Matrix3Xd& mass_;
    const ChangingConditions& changing_;
    const NodalConditions* conditions_ = nullptr;
    const DynamicsOptions& options_;
    Observer& observer_;
    Matrix3Xd applied_;
    Matrix3Xd mode_;
    double tolerance_;
    double start_time_, end_time_;
    double first_total_ = 0, exchanged_ = 0;
    DynamicsResult result_;
};

void require_options(const DynamicsOptions& options, double duration) {
    if (!(duration > 0) || !std::isfinite(duration))
        throw InvalidInput("the duration of the dynamics is " + std::to_string(duration) + " s; it must be positive");
    if (!(options.damping >= 0) || !(options.step >= 0) || !(options.safety > 0 && options.safety < 1) ||
        options.steps_per_check < 1 || !(options.energy_tolerance > 0))
        throw InvalidInput(
            "dynamics needs damping and step of at least 0, a safety between 0 and 1, a check at least every step and "
            "a "
            "positive energy tolerance");
    if (!std::is_sorted(options.stops.begin(), options.stops.end()))
        throw InvalidInput("the stops of the dynamics are not in the order of time");
}

}  // namespace

DynamicsResult dynamics(Engine& engine, const RestState& rest, const Matrix3Xd& mass, const NodalConditions& conditions,
                        const DynamicsState& start, double duration, const DynamicsOptions& options,
                        Observer& observer) {
    const auto always = [&](double) -> const NodalConditions& { return conditions; };
    return dynamics(engine, rest, mass, ChangingConditions{always, 0}, start, duration, options, observer);
}

DynamicsResult dynamics(Engine& engine, const RestState& rest, const Matrix3Xd& mass,
                        const ChangingConditions& conditions, const DynamicsState& start, double duration,
                        const DynamicsOptions& options, Observer& observer) {
    require_options(options, duration);
    if (!(conditions.interval >= 0)) throw InvalidInput("conditions are held for an interval of 0 s or more");
    return Run(engine, rest, mass, conditions, start, duration, options, observer).run();
}

}  // namespace tissuewarp::tled
