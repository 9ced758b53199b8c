#include "tled/detail/interpolation_reach.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>

namespace tissuewarp::tled::detail {
namespace {

/// Of neighbours along each axis, mm.
std::array<float, 3> largest_differences(const DistanceGrid& grid) {
    const auto size = [&](int axis) { return static_cast<std::size_t>(grid.size[axis]); };
    const std::size_t row = size(0), layer = row * size(1);
    std::array<float, 3> largest{};
    const float* d = grid.distance.data();
    const auto compare = [&](std::size_t axis, const float* other) {
        largest[axis] = std::max(largest[axis], std::abs(*other - *d));
    };
    for (std::size_t k = 0; k < size(2); ++k)
        for (std::size_t j = 0; j < size(1); ++j)
            for (std::size_t i = 0; i < size(0); ++i, ++d) {
                if (i + 1 < size(0)) compare(0, d + 1);
                if (j + 1 < size(1)) compare(1, d + row);
                if (k + 1 < size(2)) compare(2, d + layer);
            }
    return largest;
}

}  // namespace

/// For t in [0, ½] past the nearest sample the weights' sizes sum to 1.25 at most along an axis, and those times the
/// samples' distances in steps to 0.75, both at ½; the three axes multiply.
double interpolation_reach(const DistanceGrid& grid) {
    constexpr double rounding = 1.0001;
    const std::array<float, 3> difference = largest_differences(grid);
    return rounding * 1.25 * 1.25 * 0.75 * static_cast<double>(difference[0] + difference[1] + difference[2]);
}

/// Between two samples the derivative is a sum of the differences of neighbours whose weights' sizes sum to 1.5 at
/// most, at the middle; the weights of the other two axes sum to 1.25 each.
double interpolation_steepness(const DistanceGrid& grid) {
    constexpr double rounding = 1.0001;
    const std::array<float, 3> difference = largest_differences(grid);
    const double per_step = 1.5 * 1.25 * 1.25 * std::hypot(difference[0], difference[1], difference[2]);
    return rounding * per_step * grid.steps.inverse().norm();
}

}  // namespace tissuewarp::tled::detail
