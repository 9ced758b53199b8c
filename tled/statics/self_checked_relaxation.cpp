// Dynamic relaxation that no triangular solve starts or checks: from the state it is given, and stopped by how its own
// movement contracts: the stiffness at rest is multiplied with, and never factorised. Its work grows as the nodes times
// the square root of the condition, and on a GPU nothing but states leaves the device.

#include "core/cancel_only.hpp"
#include "tled/statics/heavy_ball.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;

namespace {

/// Loads that act at once make waves of up to twice the displacement that they leave. Steps without momentum make
/// none, and momentum that grows slowly makes small ones.
struct Opening {
    int steps;
    double momentum;
};
constexpr std::array openings{Opening{4, 0.0}, Opening{6, 0.5}, Opening{10, 0.75}, Opening{20, 0.87}};

constexpr double neper_a_window = 1;     // foreseen decay between two looks
constexpr double slowest = 0.95;         // contraction of a window that is still believed
constexpr double estimate_safety = 1.5;  // of the error: modes and directions do not add up to a bound
constexpr int most_idle_windows = 12;    // without the movement falling by a tenth

class SelfCheckedRelaxation {
public:
    /// Of a load of which this is a part, and whose answer is to be drawn out, errors may be a tenth.
    explicit SelfCheckedRelaxation(EquilibriumSearch& search, double part_of_load = 1)
        : search_(search),
          part_of_load_(part_of_load),
          mass_(search.stiffness.diagonal(search.conditions)),
          lowest_at_rest_(search.stiffness.approximate_lowest_eigenvalue()) {
        search_.engine.set_mass(mass_);
    }

    EquilibriumResult run(const Matrix3Xd* start) {
        search_.keep(first_state(start), unknown_error());
        if (settle_as_before()) return finished(search_.options.known_highest);
        spectrum_ = spectrum_here();
        if (relax()) return finished(spectrum_.highest);
        if (start == nullptr && start_from_part() && relax()) return finished(spectrum_.highest);
        Spectrum here;
        do {
            go_back(search_, ++restarts_);
            here = spectrum_here();
            spectrum_ = shortened(here, restarts_);
        } while (!relax());
        return finished(here.highest);
    }

private:
    EquilibriumSearch& search_;
    double part_of_load_;
    Matrix3Xd mass_;
    double lowest_at_rest_;
    Spectrum spectrum_;
    std::optional<Spectrum> sought_;  // spectrum_at() of sought_at_
    Matrix3Xd sought_at_;
    int restarts_ = 0;
    bool as_before_ = false;  // whether λ_max is that of another state

    /// At the last good state, which the engine is at: sought again only where that has moved.
    [[nodiscard]] Spectrum spectrum_here() {
        if (!sought_ || sought_at_ != search_.last_good()) {
            sought_ = spectrum_at(search_, mass_, search_.residual(), lowest_at_rest_);
            sought_at_ = search_.last_good();
        }
        return *sought_;
    }

    /// With λ_max as it is known; otherwise, and where that proves wrong, leaves the engine at the last good state.
    bool settle_as_before() {
        if (!(search_.options.known_highest > 0)) return false;
        spectrum_ = spectrum_of(search_.options.known_highest, search_, mass_, lowest_at_rest_);
        as_before_ = true;
        const bool settled = relax();
        as_before_ = false;
        if (!settled && !search_.admissible(search_.last_good())) search_.fail_stalled();
        return settled;
    }

    EquilibriumResult finished(double highest) {
        EquilibriumResult result = search_.finish();
        result.highest = highest;
        return result;
    }

    [[nodiscard]] double unknown_error() const { return 1e3 * search_.options.tolerance_mm; }

    [[nodiscard]] double allowed(const Matrix3Xd& answer) const {
        constexpr double of_part = 0.1;
        const double tolerance = search_.options.tolerance_mm;
        return part_of_load_ < 1 ? std::max(tolerance, of_part * largest_norm(answer)) : tolerance;
    }

    /// The start, or rest; where displacements are imposed on tissue at rest, which they would tear, about the linear
    /// answer, or what a factor makes of it.
    Matrix3Xd first_state(const Matrix3Xd* start) {
        const NodalConditions& conditions = search_.conditions;
        const Matrix3Xd rest = Matrix3Xd::Zero(3, conditions.constrained.cols());
        const Matrix3Xd imposed = conditions.constrained.select(conditions.imposed, rest);
        if (start == nullptr && !imposed.isZero(0)) {
            const double part = harmless_part();
            if (part < 1) return drawn_out(part);
        }
        const Matrix3Xd u = conditions.constrained.select(imposed, start != nullptr ? *start : rest);
        return search_.admissible(u) ? u : search_.begin(start);
    }

    Matrix3Xd drawn_out(double part) {
        const std::optional<Matrix3Xd> linear = answer_drawn_out(part);
        if (linear) return *linear;
        search_.observer.note("no start from a small part of the load; the stiffness is factorised for one");
        return search_.begin(nullptr);
    }

    /// Springs that pull at once at a fine surface move its first layer before what is below follows, and tear it. The
    /// answer to a part of all loads, in turn begun with a part of that where it tears too, is a start that does not.
    bool start_from_part() {
        constexpr double part = 0.25, least = 1e-4;
        if (part * part_of_load_ < least || !search_.conditions.imposed.isZero(0)) return false;
        const std::optional<Matrix3Xd> drawn = answer_drawn_out(part);
        if (!drawn) return false;
        search_.observer.note("loads that would tear tissue at once: begun with the answer to a part of them");
        search_.keep(*drawn, unknown_error());
        spectrum_ = spectrum_here();
        return true;
    }

    /// Where a part of all loads leads, times 1/part.
    std::optional<Matrix3Xd> answer_drawn_out(double part) {
        const NodalConditions conditions = scaled(search_.conditions, part);
        EquilibriumOptions options = search_.options;
        options.tolerance_mm *= part;
        options.known_highest = 0;
        CancelOnly observer(search_.observer);
        EquilibriumSearch search(search_.engine, search_.stiffness, conditions, options, observer);
        const Matrix3Xd* start = conditions.imposed.isZero(0) ? nullptr : &conditions.imposed;
        std::optional<EquilibriumResult> found;
        try {
            found = SelfCheckedRelaxation(search, part * part_of_load_).run(start);
        } catch (const SolverFailure&) {
        }
        search_.engine.set_conditions(search_.conditions);
        if (!found) return std::nullopt;
        search_.require_evaluations(found->force_evaluations);
        const Matrix3Xd u =
            search_.conditions.constrained.select(search_.conditions.imposed, found->displacement / part);
        const bool fit = search_.admissible(u) && search_.engine.smallest_jacobian().value > least_starting_jacobian;
        return fit ? std::optional(u) : std::nullopt;
    }

    /// Of the imposed displacements: tissue at rest answers it about linearly where it meets it.
    [[nodiscard]] double harmless_part() {
        constexpr double nearly = 0.1, least = 1e-6;
        double part = 1;
        std::optional<Matrix3Xd> force = force_at(part);
        for (; part > least; part /= 2) {
            const std::optional<Matrix3Xd> half = force_at(part / 2);
            if (force && half && (2 * *half - *force).norm() <= nearly * force->norm()) break;
            force = half;
        }
        search_.engine.set_conditions(search_.conditions);
        return part;
    }

    /// Internal forces with a part of the displacements imposed on tissue at rest; none where it is inverted.
    [[nodiscard]] std::optional<Matrix3Xd> force_at(double part) {
        const NodalConditions conditions = scaled(search_.conditions, part);
        search_.engine.set_conditions(conditions);
        if (!search_.admissible(conditions.imposed)) return std::nullopt;
        search_.require_evaluations(1);
        return search_.engine.internal_force();
    }

    /// False where tissue was inverted.
    bool relax() {
        std::optional<Matrix3Xd> opened = open();
        return opened && settle(std::move(*opened));
    }

    /// One look at the end suffices: tissue inverted on the way has come right again there, or shows.
    std::optional<Matrix3Xd> open() {
        const StepCoefficients last = heavy_ball(spectrum_);
        std::vector<Steps> steps;
        for (const Opening& opening : openings) {
            if (!(opening.momentum < last.momentum)) break;
            steps.push_back({opening.steps, {opening.momentum, 1 / spectrum_.highest}});
        }
        return search_.stepped(steps);
    }

    /// Windows of steps until what is left after the last is foreseen to be less than the tolerance; false where tissue
    /// was inverted. Movements d of windows that contract by q leave q/(1 − q) d.
    bool settle(Matrix3Xd before) {
        double last = 0, least = 0;
        for (int window = 0, idle = 0;; ++window) {
            const int steps = static_cast<int>(std::ceil(neper_a_window / decay(spectrum_)));
            std::optional<Matrix3Xd> after = search_.stepped(std::array{Steps{steps, heavy_ball(spectrum_)}});
            if (!after) return false;
            const double moved = largest_difference(*after, before), foreseen = std::exp(-neper_a_window);
            const double seen = window == 0 ? slowest : moved / std::max(last, 1e-300);
            if (as_before_ && seen > 1 && moves_as_the_stiffest()) return false;
            const double contraction = std::clamp(seen, foreseen, slowest);
            const double error =
                estimate_safety * contraction / (1 - contraction) * std::max(moved, contraction * last);
            search_.keep(*after, window == 0 ? unknown_error() : error);
            if (window > 0 && error <= allowed(*after)) return true;
            if (window > 1 && std::log(seen) > -0.4 * neper_a_window) spectrum_.lowest *= 0.6;
            if (window == 0 || moved < 0.9 * least) idle = 0, least = moved;
            if (++idle > most_idle_windows) {
                if (as_before_) return false;
                search_.fail_stalled();
            }
            before = std::move(*after);
            last = moved;
        }
    }

    /// Steps that are too long for the stiffest elements let these swing ever more: by the Rayleigh quotient of the
    /// last increments, which smooth movement leaves small.
    [[nodiscard]] bool moves_as_the_stiffest() {
        search_.require_evaluations(2);
        const Observation seen = search_.engine.observe();
        return !(seen.increment_stiffness < 0.5 * spectrum_.highest * seen.increment_mass);
    }
};

}  // namespace

EquilibriumResult self_checked_relaxation(EquilibriumSearch& search, const Matrix3Xd* start) {
    return SelfCheckedRelaxation(search).run(start);
}

}  // namespace tissuewarp::tled::detail
