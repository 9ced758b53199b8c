#include "tled/model/interpolation_reach.hpp"

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

/// Squares of the largest second differences of samples no further than `band` from the surface: along one axis, and
/// along two, mm².
struct Bends {
    Eigen::Array3f along = Eigen::Array3f::Zero(), across = Eigen::Array3f::Zero();  // of axes 01, 12, 20
};
Bends largest_bends(const DistanceGrid& grid, float band) {
    Bends largest;
    const std::array<std::ptrdiff_t, 3> stride{1, grid.size[0], std::ptrdiff_t{grid.size[0]} * grid.size[1]};
    const auto raise = [](float& most, float bend) { most = std::max(most, bend * bend); };
    const float* d = grid.distance.data();
    Eigen::Array3i at;
    for (at[2] = 0; at[2] < grid.size[2]; ++at[2])
        for (at[1] = 0; at[1] < grid.size[1]; ++at[1])
            for (at[0] = 0; at[0] < grid.size[0]; ++at[0], ++d) {
                if (!(std::abs(*d) <= band)) continue;
                for (int a = 0; a < 3; ++a) {
                    const int b = (a + 1) % 3;
                    if (at[a] + 1 == grid.size[a]) continue;
                    const std::ptrdiff_t next = stride[static_cast<std::size_t>(a)],
                                         beside = stride[static_cast<std::size_t>(b)];
                    if (at[a] > 0) raise(largest.along[a], d[next] - 2 * *d + d[-next]);
                    if (at[b] + 1 < grid.size[b]) raise(largest.across[a], d[next + beside] - d[next] - d[beside] + *d);
                }
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

/// Between two samples with second differences s and s' the second derivative goes from 2 s − s' to 2 s' − s; mixed
/// ones have the weights of two first derivatives, 1.5 each. A cell with a piece of the surface has samples of such
/// differences up to three steps away.
double tangent_reach(const DistanceGrid& grid, double tolerance) {
    const std::array<float, 3> difference = largest_differences(grid);
    const Bends bends = largest_bends(grid, 3 * std::hypot(difference[0], difference[1], difference[2]));
    const double along = std::pow(3 * 1.25 * 1.25, 2) * static_cast<double>(bends.along.sum()),
                 across = std::pow(1.5 * 1.5 * 1.25, 2) * static_cast<double>(bends.across.sum());
    const double bend = std::sqrt(along + 2 * across) * grid.steps.inverse().squaredNorm();
    return std::sqrt(2 * tolerance / bend);
}

}  // namespace tissuewarp::tled::detail
