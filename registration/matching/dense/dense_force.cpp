#include "registration/matching/dense/dense_cells.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

/// The sums of the voxels of a cell that begins with `begin`.
CellSums sums_of(const Voxel& begin, const MatchingImage& first, const MatchingImage& second,
                 const std::vector<std::uint8_t>& counts) {
    const auto& size = first.grid.size;
    const std::array<std::ptrdiff_t, 3> stride{1, size[0], std::ptrdiff_t{size[0]} * size[1]};
    const std::uint8_t *seen_first = first.seen.data(), *seen_second = second.seen.data();
    const auto shown = [&](std::ptrdiff_t n) { return seen_first[n] && seen_second[n]; };
    const auto end = [&](std::size_t axis) { return std::min(begin[axis] + CellGrid::side, size[axis] - 1); };
    std::array<std::ptrdiff_t, CellGrid::side * CellGrid::side * CellGrid::side> voxels;
    static_assert(voxels.size() <= most_product_voxels);
    std::size_t count = 0;
    Eigen::Vector3d index = Eigen::Vector3d::Zero();
    for (int k = begin[2]; k < end(2); ++k)
        for (int j = begin[1]; j < end(1); ++j)
            for (int i = begin[0]; i < end(0); ++i) {
                const std::ptrdiff_t n = first.offset({i, j, k});
                if (!counts[static_cast<std::size_t>(n)] || !shown(n)) continue;
                if (!std::all_of(stride.begin(), stride.end(), [&](auto s) { return shown(n - s) && shown(n + s); }))
                    continue;
                voxels[count++] = n;
                index += Eigen::Vector3d(i, j, k);
            }
    if (count == 0) return {};
    return cell_sums(
        descriptor_products(first.descriptors.get(), second.descriptors.get(), stride, {voxels.data(), count}),
        double(count), index);
}

}  // namespace

bool DenseForces::say_something_at(const Eigen::Vector3d& point) const {
    const Eigen::Array3d index = cells.index(point).array().round();
    const Eigen::Array3d last(cells.size[0] - 1, cells.size[1] - 1, cells.size[2] - 1);
    if (!(index >= 0).all() || !(index <= last).all()) return false;
    const auto [i, j, k] = Voxel{static_cast<int>(index[0]), static_cast<int>(index[1]), static_cast<int>(index[2])};
    return said[static_cast<std::size_t>(i + std::int64_t{cells.size[0]} * (j + std::int64_t{cells.size[1]} * k))] != 0;
}

DenseForces dense_forces(const MatchingImage& first, const MatchingImage& second,
                         const std::vector<std::uint8_t>& counts) {
    const CellGrid cells(first.grid);
    std::vector<CellSums> own(cells.count());
    tbb::parallel_for(std::size_t{0}, own.size(),
                      [&](std::size_t n) { own[n] = sums_of(cells.first_voxel(n), first, second, counts); });
    WindowMemory memory;
    return forces_of(own, cells, first.grid, memory);
}

}  // namespace tissuewarp::registration::detail
