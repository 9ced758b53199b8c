#include "registration/schedule.hpp"

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

/// Geometric from the first to the last.
double range_of(const UpdateOptions& options, int round) {
    if (options.rematches < 2) return options.last_range_mm;
    const double t = double(round) / (options.rematches - 1);
    return options.first_range_mm * std::pow(options.last_range_mm / options.first_range_mm, t);
}

}  // namespace

Schedule::Schedule(const UpdateOptions& options, int searches) : settled_mm_(options.settled_mm) {
    constexpr RoundLimits limits;
    const int count = std::max(1, options.rematches);
    for (int search = 0; search < searches; ++search) searches_.push_back(search * count / searches);
    for (int n = 0; n < count; ++n) {
        const double range = range_of(options, n);
        const double scale =
            n == 0 ? limits.first_scale_mm : std::max(options.residual_scale_mm, range / limits.scales_of_range);
        const auto due = std::upper_bound(searches_.begin(), searches_.end(), n) - searches_.begin();
        rounds_.push_back({n, n == count - 1, range, scale, options.most_step_mm, static_cast<int>(due)});
    }
}

RoundPlan Schedule::last_with_more_searches(int more) const {
    RoundPlan plan = last();
    plan.searches_due = static_cast<int>(searches_.size()) + more;
    return plan;
}

int Schedule::after(int number, const Round& record) const {
    constexpr RoundLimits limits;
    if (record.held_back > limits.most_held_back * record.matched) return number;
    const int last_number = count() - 1;
    const auto due = static_cast<std::size_t>(round(number).searches_due);
    const bool searches_left = due < searches_.size();
    const double limit = searches_left ? std::max(settled_mm_, limits.settled_before_search_mm) : settled_mm_;
    if (record.largest_change_mm >= limit) return number + 1;
    if (searches_left) return std::max(number + 1, std::min(last_number, searches_[due]));
    return number < last_number ? last_number : count();
}

}  // namespace tissuewarp::registration::detail
