#pragma once
/// Percentiles: linear between order statistics, numpy's default.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace tissuewarp::registration::detail {

/// Percentiles, in ascending order, of a vector that is reordered: `values` must hold at least one. Each is sought
/// beyond the one before.
template <class T, std::size_t count>
std::array<double, count> percentiles(std::vector<T>& values, const std::array<double, count>& percents) {
    std::array<double, count> result;
    auto begin = values.begin();
    for (std::size_t n = 0; n < count; ++n) {
        const double position = percents[n] / 100.0 * static_cast<double>(values.size() - 1);
        const auto lower = values.begin() + static_cast<std::ptrdiff_t>(position);
        std::nth_element(begin, lower, values.end());
        begin = lower;
        const double fraction = position - std::floor(position), low = *lower;
        result[n] = low;
        if (fraction > 0)
            result[n] += fraction * (static_cast<double>(*std::min_element(lower + 1, values.end())) - low);
    }
    return result;
}

/// One of them.
template <class T>
double percentile(std::vector<T>& values, double percent) {
    return percentiles(values, std::array{percent})[0];
}

}  // namespace tissuewarp::registration::detail
