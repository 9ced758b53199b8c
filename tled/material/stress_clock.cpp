#include "tled/material/stress_clock.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::tled::detail {
namespace {

constexpr double steps_of_relaxation = 32;
/// A shorter rest does not pay for the dispatches of a GPU by which stresses move.
constexpr int fewest_steps_of_rest = 16;

void append(std::vector<StressSteps>& all, const StressSteps& next) {
    if (!all.empty() && all.back().interval == next.interval)
        all.back().count += next.count;
    else
        all.push_back(next);
}

}  // namespace

StressClock::StressClock(const std::vector<PronySeries>& series, StressPace pace) : pace_(pace) {
    for (const PronySeries& each : series)
        for (const PronyTerm& term : each.terms) shortest_ = std::min(shortest_, term.relaxation_time);
}

std::vector<StressSteps> StressClock::next(int steps, double time_step) {
    if (!(time_step > 0) || std::isinf(shortest_)) return {{steps, 0}};
    if (time_step != time_step_) change_time_step(time_step);
    std::vector<StressSteps> all;
    while (steps > 0) {
        const auto left = static_cast<int>(std::lround(hold_ / time_step_)) - since_;
        const StressSteps next = left > 0 ? StressSteps{std::min(left, steps), 0} : StressSteps{1, move()};
        append(all, next);
        since_ += next.count;
        steps -= next.count;
    }
    return all;
}

void StressClock::forget() {
    ahead_ = hold_ = 0;
    since_ = 0;
}

int StressClock::steps_of_interval() const {
    if (pace_ == StressPace::EveryStep) return 1;
    const double steps = std::floor(shortest_ / (steps_of_relaxation * time_step_));
    return steps < fewest_steps_of_rest ? 1 : static_cast<int>(std::min(steps, 1e6));
}

void StressClock::change_time_step(double time_step) {
    ahead_ -= since_ * time_step_;
    hold_ -= since_ * time_step_;
    since_ = 0;
    time_step_ = time_step;
}

/// The interval of the step that they take.
double StressClock::move() {
    const double hold = steps_of_interval() * time_step_, interval = 0.5 * hold + lag();
    ahead_ = 0.5 * hold;
    hold_ = hold;
    since_ = 0;
    return interval;
}

}  // namespace tissuewarp::tled::detail
