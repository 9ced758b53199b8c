#pragma once
/// Percentiles: linear between order statistics, numpy's default.

#include <algorithm>
#include <cmath>
#include <vector>

namespace tissuewarp::registration::detail {

/// Percentile of a vector that is reordered: `values` must hold at least one.
template <class T>
double percentile(std::vector<T>& values, double percent) {
    const double position = percent / 100.0 * static_cast<double>(values.size() - 1);
    const auto lower = values.begin() + static_cast<std::ptrdiff_t>(position);
    std::nth_element(values.begin(), lower, values.end());
    const double fraction = position - std::floor(position), low = *lower;
    if (fraction == 0.0) return low;
    return low + fraction * (static_cast<double>(*std::min_element(lower + 1, values.end())) - low);
}

}  // namespace tissuewarp::registration::detail
