#include "tled/load_path.hpp"

#include "tled/damped_motion.hpp"
#include "tled/model/kinematics.hpp"
#include "tled/statics/finite_rotations.hpp"
#include "tled/stiffness/tangent_factor.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/errors.hpp"

namespace tissuewarp::tled {

using Eigen::Matrix3Xd;

namespace {

constexpr const char* may_be_of_several =
    "on the way the tissue moved on faster than its load foretold: where it buckles or snaps through there are several "
    "equilibria, of which this is a stable one";

class LoadPath {
public:
    LoadPath(Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions,
             const LoadPathOptions& options, const Matrix3Xd* start, Observer& observer)
        : engine_(engine),
          stiffness_(stiffness),
          conditions_(conditions),
          options_(options),
          observer_(observer),
          from_rest_(start == nullptr),
          origin_(from_rest_ ? Matrix3Xd::Zero(3, conditions.constrained.cols()) : *start),
          now_{0, origin_} {}

    EquilibriumResult run() {
        if (!follow()) give_up();
        return std::move(result_);
    }

    EquilibriumResult run_with_motion() {
        if ((follow() && judged()) || found_after_motion()) return std::move(result_);
        give_up();
    }

private:
    bool judged() {
        try {
            result_ = judged_by_tangent(engine_, stiffness_, conditions_, equilibrium_options(), result_, observer_);
            return true;
        } catch (const SolverFailure& failure) {
            cause_ = failure.what();
            return false;
        }
    }

    /// Whether the path leads to the whole load.
    bool follow() {
        double part = 1.0 / options_.first_parts;
        if (part == 1 && coarse_start_pays() && asked_coarse_start().method == EquilibriumMethod::Newton) {
            if (found_from_coarse_start()) return true;
            if (goes_far(1)) part = moderate_part();
        }
        while (now_.load < 1) {
            const double load = now_.load + part > 1 - 1e-9 ? 1 : now_.load + part;
            if (advance(load)) {
                part *= 1.5;
            } else {
                part = std::min(0.5 * (load - now_.load), moderate_part());
                if (part < options_.smallest_part || !leads_on()) return false;
            }
        }
        if (led_too_far_) observer_.note(may_be_of_several);
        return true;
    }

    struct Point {
        double load;
        Matrix3Xd displacement;
    };

    /// With the factor that the whole path shares.
    [[nodiscard]] EquilibriumOptions equilibrium_options() {
        EquilibriumOptions options = options_.equilibrium;
        if (options.rest == nullptr) return options;
        if (!tangent_) tangent_ = std::make_unique<detail::TangentFactor>(*options.rest, conditions_.constrained);
        options.tangent = tangent_.get();
        return options;
    }

    [[nodiscard]] NodalConditions at(double load) const {
        if (from_rest_) return scaled(conditions_, load);
        NodalConditions partial = conditions_;
        const Matrix3Xd origin = conditions_.constrained.select(origin_, Matrix3Xd::Zero(3, origin_.cols()));
        partial.imposed = origin + load * (conditions_.imposed - origin);
        return partial;
    }

    /// Whether a part of the load is another problem than all of it.
    [[nodiscard]] bool leads_on() const {
        return from_rest_ || (conditions_.constrained.array() && conditions_.imposed.array() != origin_.array()).any();
    }

    /// Of the load, what moves tissue by a moderate part of its size if it were linear; 1 where the size is not known.
    [[nodiscard]] double first_part() {
        if (!from_rest_ || options_.equilibrium.rest == nullptr) return 1;
        if (!moderate_part_) {
            constexpr double of_diagonal = 0.2;
            const Matrix3Xd& position = options_.equilibrium.rest->position;
            const double diagonal = (position.rowwise().maxCoeff() - position.rowwise().minCoeff()).norm(),
                         linear = stiffness_.linear_solution(conditions_).colwise().norm().maxCoeff();
            moderate_part_ = std::max(of_diagonal * diagonal / linear, 2 * options_.smallest_part);
        }
        return *moderate_part_;
    }
    /// The same of what has not begun.
    [[nodiscard]] double moderate_part() { return now_.load > 0 ? 1 : first_part(); }

    /// Where a linear answer is far beyond the tissue's size the methods that begin with it take longer to fail than a
    /// path to arrive, or a coarser mesh to tell where it leads.
    [[nodiscard]] bool goes_far(double load) {
        constexpr double most_of_moderate = 4;
        return from_rest_ && decides() && load > most_of_moderate * first_part();
    }
    [[nodiscard]] bool coarse_start_pays() {
        constexpr double most_of_moderate = 2;
        return options_.coarse_start && from_rest_ && decides() && engine_.processor() == Processor::Cpu &&
               most_of_moderate * first_part() < 1;  // on a GPU K₀ is not factorised before it must
    }

    [[nodiscard]] const CoarseStart& asked_coarse_start() {
        if (!coarse_start_)
            coarse_start_ = options_.coarse_start().value_or(CoarseStart{{}, EquilibriumMethod::Automatic});
        return *coarse_start_;
    }

    /// Under the whole load; not twice.
    bool found_from_coarse_start() {
        constexpr int most = 80;  // force evaluations: then a path is shorter
        if (!options_.coarse_start || asked_coarse_start().displacement.size() == 0) return false;
        EquilibriumOptions options = equilibrium_options();
        options.method = EquilibriumMethod::Newton;
        options.max_steps = most;
        const Matrix3Xd start = rotations().like(coarse_start_->displacement, conditions_);
        coarse_start_->displacement.resize(3, 0);
        return found_equilibrium(1, conditions_, options, &start);
    }

    [[nodiscard]] const detail::FiniteRotations& rotations() {
        if (!rotations_)
            rotations_ = std::make_unique<detail::FiniteRotations>(*options_.equilibrium.rest, conditions_);
        return *rotations_;
    }

    /// On through the last two equilibria, turned by finite angles; from the first only with the imposed displacements
    /// moved.
    [[nodiscard]] Matrix3Xd predicted(double load, const NodalConditions& partial) {
        Matrix3Xd step = Matrix3Xd::Zero(3, now_.displacement.cols());
        if (before_)
            step = (load - now_.load) / (now_.load - before_->load) * (now_.displacement - before_->displacement);
        step = partial.constrained.select(partial.imposed - now_.displacement, step);
        const RestState* rest = options_.equilibrium.rest;
        if (!before_ || rest == nullptr) return now_.displacement + step;
        Matrix3Xd moved = rotations().moved(now_.displacement, step);
        if (detail::element_jacobians(*rest, moved).minCoeff() > 0) return moved;
        led_too_far_ = true;
        return partial.constrained.select(partial.imposed, now_.displacement);
    }

    bool advance(double load) {
        const NodalConditions partial = at(load);
        EquilibriumOptions options = equilibrium_options();
        constexpr double loose = 10;  // of the tolerance, on the way
        options.on_the_way = load < 1;
        if (options.on_the_way) options.tolerance_mm *= loose;
        const bool others_failed = result_.method == EquilibriumMethod::Newton;
        if (others_failed || (before_ && moderate_part_ && goes_far(1))) options.method = EquilibriumMethod::Newton;
        const bool first = from_rest_ && !before_ && now_.load == 0;
        if (first) options.last = EquilibriumMethod::Lbfgs;
        const Matrix3Xd prediction = predicted(load, partial);
        const Matrix3Xd* start = first ? nullptr : &prediction;
        if (found_equilibrium(load, partial, options, start)) return true;
        if (!first || !decides()) return false;
        if (load == 1 && found_from_coarse_start()) return true;
        if (goes_far(load)) return false;
        options.method = EquilibriumMethod::Newton;
        return found_equilibrium(load, partial, options, start);
    }

    bool found_equilibrium(double load, const NodalConditions& partial, const EquilibriumOptions& options,
                           const Matrix3Xd* start) {
        try {
            EquilibriumResult found = equilibrium(engine_, stiffness_, partial, options, start, observer_);
            found.force_evaluations += result_.force_evaluations;
            found.lifted_residuals += result_.lifted_residuals;
            before_ = std::exchange(now_, {load, found.displacement});
            result_ = std::move(found);
            return true;
        } catch (const SolverFailure& failure) {
            cause_ = failure.what();
            return false;
        }
    }

    /// Beyond a limit point or a buckling load equilibria lie elsewhere, where only motion leads.
    bool found_after_motion() {
        const RestState* rest = options_.equilibrium.rest;
        if (!decides() || !rest->viscosity.empty()) return false;
        const double reached = now_.load;
        const std::string cause = cause_;  // rather than that of the motion
        observer_.note("no equilibrium near " + percent(reached) + " of the load: damped motion leads on from there");
        if (!leads_to_equilibrium(*rest, reached)) {
            cause_ = cause;
            return false;
        }
        observer_.note("at " + percent(reached) +
                       " of the load the tissue buckles, snaps through or topples: the equilibrium is the one to which "
                       "damped motion leads from there");
        return true;
    }

    bool leads_to_equilibrium(const RestState& rest, double reached) {
        EquilibriumOptions options = equilibrium_options();
        options.method = EquilibriumMethod::Newton;
        const auto loads = [&](double part) { return at(reached + part * (1 - reached)); };
        try {
            const Matrix3Xd start = displacement_after_motion(engine_, rest, loads, now_.displacement, observer_);
            return found_equilibrium(1, conditions_, options, &start);
        } catch (const SolverFailure&) {
            return false;
        }
    }

    static std::string percent(double load) {
        char digits[16];
        std::snprintf(digits, sizeof digits, "%.1f %%", 100 * load);
        return digits;
    }

    /// Whether Newton's method may be taken as the last resort.
    [[nodiscard]] bool decides() const {
        const EquilibriumOptions& options = options_.equilibrium;
        return options.last == EquilibriumMethod::Newton && options.method == EquilibriumMethod::Automatic &&
               options.rest != nullptr && !conditions_.effects.contact;
    }

    [[noreturn]] void give_up() {
        engine_.set_conditions(at(now_.load));
        engine_.set_state(now_.displacement, Matrix3Xd::Zero(3, origin_.cols()));
        throw SolverFailure("the load could be applied to " + std::to_string(100 * now_.load) +
                            " % only, where the engine is left: " + cause_);
    }

    Engine& engine_;
    const RestStiffness& stiffness_;
    const NodalConditions& conditions_;
    const LoadPathOptions& options_;
    Observer& observer_;
    bool from_rest_;
    Matrix3Xd origin_;
    Point now_;
    std::optional<Point> before_;
    std::optional<double> moderate_part_;
    std::optional<CoarseStart> coarse_start_;  // by asked_coarse_start(), without displacement where there is none
    bool led_too_far_ = false;                 // the line through the last two equilibria, once
    std::unique_ptr<detail::FiniteRotations> rotations_;  // by rotations()
    std::unique_ptr<detail::TangentFactor> tangent_;
    std::string cause_;
    EquilibriumResult result_;
};

void require_usable(const LoadPathOptions& options) {
    if (options.first_parts < 1 || !(options.smallest_part > 0))
        throw InvalidInput("a load path needs at least one part and a positive smallest part");
}

}  // namespace

EquilibriumResult equilibrium_along_load(Engine& engine, const RestStiffness& stiffness,
                                         const NodalConditions& conditions, const LoadPathOptions& options,
                                         const Matrix3Xd* start, Observer& observer) {
    require_usable(options);
    return LoadPath(engine, stiffness, conditions, options, start, observer).run();
}

EquilibriumResult equilibrium_along_load_or_motion(Engine& engine, const RestStiffness& stiffness,
                                                   const NodalConditions& conditions, const LoadPathOptions& options,
                                                   const Matrix3Xd* start, Observer& observer) {
    require_usable(options);
    return LoadPath(engine, stiffness, conditions, options, start, observer).run_with_motion();
}

}  // namespace tissuewarp::tled
