#pragma once
/// Costs of Gaussian windows about every few voxels of a grid, at every shift of a lattice. What voxels add is summed
/// up in bricks first, as wide as the places are apart: a window weighs the voxels of a brick alike.

#include "registration/matching/ultrasound/brick_windows.hpp"
#include "registration/matching/ultrasound/echo_costs.hpp"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <cstddef>
#include <limits>
#include <vector>

namespace tissuewarp::registration::detail {

/// How windows are shifted and which count; see EchoCostOptions.
struct ShiftedWindows {
    double window_mm;
    int reach, stride;  ///< voxels: shifts of up to the one, places apart by the other
    double least_share, most_lost;
};
ShiftedWindows windows_of(const EchoCostOptions& options);

/// Sums (Eigen arrays) of bricks, and smoothed along one axis and along two; 0 where nothing is ever written.
template <class Sums>
struct BrickSums {
    explicit BrickSums(std::size_t count) : raw(count, zero()), along_k(raw), along_kj(raw) {}
    std::vector<Sums> raw, along_k, along_kj;

    static Sums zero() { return Sums::Zero(); }
};

/// Of the window about a brick, along one axis.
template <class Sums>
Sums along(int axis, std::size_t brick, const BrickWindows& windows, const std::vector<Sums>& from) {
    const auto [first, last] = windows.window(axis, brick);
    const std::ptrdiff_t step = windows.step(axis);
    const Sums* source = &from[brick];
    Sums sum = Sums::Zero();
    for (int d = first; d <= last; ++d) sum += windows.weight(d) * source[d * step];
    return sum;
}

/// What the windows about the places hold when the moving image is shifted; `each(n, sums)` of every place.
template <class Sums, class Add, class Each>
void window_sums(const BrickWindows& windows, const Eigen::Vector3i& shift, const Add& add, BrickSums<Sums>& work,
                 const Each& each) {
    for (const std::size_t brick : windows.filled()) work.raw[brick] = Sums::Zero();
    windows.each_voxel(shift,
                       [&](std::size_t n, std::size_t from, std::size_t brick) { add(n, from, work.raw[brick]); });
    for (const std::size_t brick : windows.along_k()) work.along_k[brick] = along(2, brick, windows, work.raw);
    for (const std::size_t brick : windows.along_kj()) work.along_kj[brick] = along(1, brick, windows, work.along_k);
    for (std::size_t n = 0; n < windows.places().size(); ++n)
        each(n, along(0, windows.places()[n], windows, work.along_kj));
}

/// Of windows about their places; no cost is known.
inline EchoCosts costs_to_be(const BrickWindows& windows, const ShiftedWindows& how, double step_mm) {
    EchoCosts result;
    result.step_mm = step_mm;
    result.reach = how.reach;
    result.places = windows.grid();
    result.at = windows.places();
    result.window_share = windows.shares();
    result.cost.resize(result.at.size() * result.lattice());
    return result;
}

/// `add(n, from, sums)` what a voxel of the ultrasound that is seen adds where the moving image's voxel `from` is
/// shifted to it: 1 first, and nothing where that is not shown. `cost(sums)` of a window. Threads do not change the
/// result.
template <class Sums, class Add, class Cost>
EchoCosts costs_of_shifts(const EchoImages& images, const ShiftedWindows& how, const Add& add, const Cost& cost) {
    const BrickWindows windows(images, how.stride, how.window_mm, how.least_share);
    EchoCosts result = costs_to_be(windows, how, images.grid.spacing[0]);
    const std::size_t lattice = result.lattice();
    const auto bricks = static_cast<std::size_t>(windows.grid().voxel_count());
    tbb::enumerable_thread_specific<BrickSums<Sums>> works([&] { return BrickSums<Sums>(bricks); });
    tbb::parallel_for(std::size_t{0}, lattice, [&](std::size_t entry) {
        window_sums(windows, result.shift(entry), add, works.local(), [&](std::size_t n, const Sums& sums) {
            const bool lost = sums[0] < (1 - how.most_lost) * result.window_share[n];
            result.cost[n * lattice + entry] = lost ? std::numeric_limits<float>::infinity() : cost(sums);
        });
    });
    return result;
}

}  // namespace tissuewarp::registration::detail
