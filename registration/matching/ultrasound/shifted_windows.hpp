#pragma once
/// Costs of Gaussian windows about every few voxels of a grid, at every shift of a lattice.

#include "registration/matching/ultrasound/echo_costs.hpp"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
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

/// How windows are shifted and which count; see EchoCostOptions.
struct ShiftedWindows {
    double window_mm;
    int reach, stride;  ///< voxels: shifts of up to the one, places apart by the other
    double least_share, most_lost;
};

/// `pixel(n, from)`: what a voxel of the ultrasound adds to the sums where the moving image's voxel `from` is shifted
/// to it, both shown; 1 first. `cost(sums)` of a window. Threads do not change the result.
template <class Sums, class Pixel, class Cost>
EchoCosts costs_of_shifts(const EchoImages& images, const ShiftedWindows& windows, const Pixel& pixel,
                          const Cost& cost) {
    const std::array<int, 3>& size = images.grid.size;
    const std::vector<float> weights = gaussian_window(windows.window_mm / images.grid.spacing[0]);
    struct Work {
        SumGrid<Sums> one, other;
    };
    const auto sums_of = [&](const Eigen::Vector3i& shift, Work& work, const auto& added) -> SumGrid<Sums>& {
        work.one.size = size;
        work.one.sums.assign(images.echo.size(), Sums::Zero());
        const std::ptrdiff_t away = shift[0] + size[0] * (shift[1] + std::ptrdiff_t{size[1]} * shift[2]);
        for (int k = std::max(0, shift[2]); k < std::min(size[2], size[2] + shift[2]); ++k)
            for (int j = std::max(0, shift[1]); j < std::min(size[1], size[1] + shift[1]); ++j)
                for (int i = std::max(0, shift[0]); i < std::min(size[0], size[0] + shift[0]); ++i) {
                    const std::ptrdiff_t there = i + size[0] * (j + std::ptrdiff_t{size[1]} * k);
                    const auto n = static_cast<std::size_t>(there), from = static_cast<std::size_t>(there - away);
                    if (images.seen[n] != 0) added(n, from, work.one.sums[n]);
                }
        return window_sums(weights, windows.stride, work.one, work.other);
    };
    EchoCosts result;
    result.step_mm = images.grid.spacing[0];
    result.reach = windows.reach;
    result.places = images.grid;
    result.places.spacing *= windows.stride;
    for (int& along : result.places.size) along = (along + windows.stride - 1) / windows.stride;
    Work work;
    const auto share = [](std::size_t, std::size_t, Sums& sums) { sums[0] = 1; };
    const SumGrid<Sums>& full = sums_of(Eigen::Vector3i::Zero(), work, share);
    for (std::size_t n = 0; n < full.sums.size(); ++n)
        if (full.sums[n][0] >= windows.least_share) {
            result.at.push_back(n);
            result.window_share.push_back(full.sums[n][0]);
        }
    const std::size_t lattice = result.lattice();
    result.cost.resize(result.at.size() * lattice);
    tbb::enumerable_thread_specific<Work> works;
    tbb::parallel_for(std::size_t{0}, lattice, [&](std::size_t entry) {
        const auto both = [&](std::size_t n, std::size_t from, Sums& sums) {
            if (images.shown[from] != 0) sums = pixel(n, from);
        };
        const SumGrid<Sums>& sums = sums_of(result.shift(entry), works.local(), both);
        for (std::size_t n = 0; n < result.at.size(); ++n) {
            const Sums& here = sums.sums[result.at[n]];
            const bool lost = here[0] < (1 - windows.most_lost) * result.window_share[n];
            result.cost[n * lattice + entry] = lost ? std::numeric_limits<float>::infinity() : cost(here);
        }
    });
    return result;
}

}  // namespace tissuewarp::registration::detail
