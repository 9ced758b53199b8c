#pragma once
/// Sums over Gaussian windows about every few voxels of a grid.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace tissuewarp::registration::detail {

/// What is summed (an Eigen array), of each voxel, i fastest.
template <class Sums>
struct SumGrid {
    std::array<int, 3> size;
    std::vector<Sums> sums;

    Sums& at(int i, int j, int k) {
        return sums[static_cast<std::size_t>(i + size[0] * (j + std::ptrdiff_t{size[1]} * k))];
    }
};

/// Of sum 1, cut off after two deviations.
inline std::vector<float> gaussian_window(double deviation_voxels) {
    constexpr double cut = 2;  // deviations
    const int radius = std::max(1, static_cast<int>(std::lround(cut * deviation_voxels)));
    std::vector<float> weights;
    float total = 0;
    for (int n = -radius; n <= radius; ++n) {
        weights.push_back(static_cast<float>(std::exp(-0.5 * std::pow(n / deviation_voxels, 2))));
        total += weights.back();
    }
    for (float& weight : weights) weight /= total;
    return weights;
}

/// Smooths along an axis and keeps every `stride`-th.
template <class Sums>
void smooth_along(std::size_t axis, const std::vector<float>& weights, int stride, SumGrid<Sums>& from,
                  SumGrid<Sums>& to) {
    const int radius = static_cast<int>(weights.size()) / 2, length = from.size[axis];
    to.size = from.size;
    to.size[axis] = (length + stride - 1) / stride;
    to.sums.resize(static_cast<std::size_t>(to.size[0]) * static_cast<std::size_t>(to.size[1]) *
                   static_cast<std::size_t>(to.size[2]));
    const std::ptrdiff_t step = axis == 0 ? 1 : axis == 1 ? from.size[0] : std::ptrdiff_t{from.size[0]} * from.size[1];
    for (int k = 0; k < to.size[2]; ++k)
        for (int j = 0; j < to.size[1]; ++j)
            for (int i = 0; i < to.size[0]; ++i) {
                std::array<int, 3> voxel{i, j, k};
                voxel[axis] *= stride;
                const int middle = voxel[axis], low = std::max(-radius, -middle),
                          high = std::min(radius, length - 1 - middle);
                const Sums* source = &from.at(voxel[0], voxel[1], voxel[2]);
                Sums sum = Sums::Zero();
                for (int n = low; n <= high; ++n)
                    sum += weights[static_cast<std::size_t>(n + radius)] * source[n * step];
                to.at(i, j, k) = sum;
            }
}

/// Over the windows about every `stride`-th voxel along each axis. The result is `other`; both are written to.
template <class Sums>
SumGrid<Sums>& window_sums(const std::vector<float>& weights, int stride, SumGrid<Sums>& one, SumGrid<Sums>& other) {
    smooth_along(2, weights, stride, one, other);
    smooth_along(1, weights, stride, other, one);
    smooth_along(0, weights, stride, one, other);
    return other;
}

}  // namespace tissuewarp::registration::detail
