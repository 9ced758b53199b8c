#pragma once
/// Integers of types that OpenCV lacks become int32 when every value fits, and float64 otherwise.

#include <algorithm>
#include <utility>
#include <vector>

namespace tissuewarp::imaging::detail {

template <class Wide>
bool all_fit_int32(const std::vector<Wide>& values) {
    return std::all_of(values.begin(), values.end(), [](Wide value) { return std::in_range<int>(value); });
}

}  // namespace tissuewarp::imaging::detail
