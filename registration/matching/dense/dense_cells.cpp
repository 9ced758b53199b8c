#include "registration/matching/dense/dense_cells.hpp"

#include "registration/matching/dense/rows_of_cells.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>

namespace tissuewarp::registration::detail {

namespace {

using Rules = DenseForceRules;

Spread spread_of(const CellSums& sums) {
    const auto& A = sums.normal;
    const ContrastSums& contrast = sums.contrast;
    Spread result;
    result << A(0, 0), A(1, 1), A(2, 2), A(0, 1), A(0, 2), A(1, 2), sums.right, sums.squares, sums.voxels,
        contrast.of_gradients.col(0), contrast.of_gradients.col(1), contrast.of_residuals, contrast.squares,
        contrast.sum;
    return result;
}

CellSums sums_of(const Spread& s) {
    CellSums result;
    result.normal << s[0], s[3], s[4], s[3], s[1], s[5], s[4], s[5], s[2];
    result.right = s.segment<3>(6);
    result.squares = s[9];
    result.voxels = s[10];
    result.contrast.of_gradients << s.segment<3>(11), s.segment<3>(14);
    result.contrast.of_residuals = s.segment<2>(17);
    result.contrast.squares = s[19];
    result.contrast.sum = s[20];
    return result;
}

/// Spreads each cell's sums over a window of one cell's deviation, (1, 4, 6, 4, 1)/16 along each axis; their total
/// stays, but for what leaves the grid.
const std::vector<Spread>& windowed(const std::vector<CellSums>& sums, const CellGrid& cells, WindowMemory& memory) {
    constexpr std::array<double, 3> weights = Rules::window;
    std::vector<Spread>&from = memory.from, &to = memory.to;
    from.resize(sums.size());
    to.resize(sums.size());
    tbb::parallel_for(std::size_t{0}, sums.size(), [&](std::size_t n) { from[n] = spread_of(sums[n]); });
    const auto& size = cells.centres().size;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::ptrdiff_t stride = cells.stride(axis);
        tbb::parallel_for(0, size[1] * size[2], [&](int row) {
            for (int i = 0; i < size[0]; ++i) {
                const std::ptrdiff_t n = i + cells.stride(1) * row;
                const int at = std::array{i, row % size[1], row / size[1]}[axis];
                Spread sum = weights[0] * from[static_cast<std::size_t>(n)];
                for (int away = 1; away <= 2; ++away) {
                    const double weight = weights[static_cast<std::size_t>(away)];
                    if (at >= away) sum += weight * from[static_cast<std::size_t>(n - away * stride)];
                    if (at + away < size[axis]) sum += weight * from[static_cast<std::size_t>(n + away * stride)];
                }
                to[static_cast<std::size_t>(n)] = sum;
            }
        });
        from.swap(to);
    }
    return from;
}

/// Takes out of A, b and the squares what D₂ = D₁ − (D₁, 1) c explains of them, c the same for all channels.
CellSums without_contrast(CellSums window) {
    const ContrastSums& contrast = window.contrast;
    const double samples = descriptor_channels * window.voxels;
    Eigen::Matrix2d common;
    common << contrast.squares + Rules::least_square * samples, contrast.sum, contrast.sum, samples;
    const Eigen::Matrix2d inverse = common.inverse();
    window.normal -= contrast.of_gradients * inverse * contrast.of_gradients.transpose();
    window.right -= contrast.of_gradients * inverse * contrast.of_residuals;
    window.squares -= contrast.of_residuals.dot(inverse * contrast.of_residuals);
    return window;
}

/// Shift and information along the axes of A, voxels.
std::optional<DenseForce> solved(const CellSums& window, const Eigen::Vector3d& place, const imaging::Geometry& grid) {
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
    axes.computeDirect(window.normal);
    const Eigen::Array3d strength = axes.eigenvalues();
    const double variance = std::max(window.squares / window.voxels, descriptor_channels * Rules::least_square);
    const Eigen::Array3d raw =
        (Rules::independent_share / variance * (strength - Rules::leakage * strength[2])).max(0.0);
    if (!(raw[2] > 0)) return std::nullopt;
    const Eigen::Array3d along = axes.eigenvectors().transpose() * window.right;
    Eigen::Vector3d shift = (raw > 0).select(along / strength, 0.0);
    if (const double length = shift.norm(); length > Rules::most_shift) shift *= Rules::most_shift / length;
    const Eigen::Vector3d information = raw / (1 + raw * Rules::least_deviation * Rules::least_deviation);
    const double h = grid.spacing[0];
    const Eigen::Matrix3d turn = grid.direction * axes.eigenvectors();
    return DenseForce{place, turn * shift * h, turn * (information / (h * h)).asDiagonal() * turn.transpose()};
}

}  // namespace

CellGrid::CellGrid(const imaging::Geometry& grid) : centres_(grid) {
    for (int& size : centres_.size) size = std::max(1, (size - 2 + side - 1) / side);
    centres_.origin = grid.point(Eigen::Vector3d::Constant(1 + 0.5 * (side - 1)));
    centres_.spacing *= side;
    stride_ = {1, centres_.size[0], std::ptrdiff_t{centres_.size[0]} * centres_.size[1]};
}

Voxel CellGrid::cell(std::size_t n) const {
    const auto place = static_cast<std::ptrdiff_t>(n);
    return {static_cast<int>(place % stride_[1]), static_cast<int>(place % stride_[2] / stride_[1]),
            static_cast<int>(place / stride_[2])};
}

Voxel CellGrid::first_voxel(std::size_t n) const {
    Voxel voxel = cell(n);
    for (int& index : voxel) index = 1 + side * index;
    return voxel;
}

CellSums cell_sums(const DescriptorProducts& products, double voxels, const Eigen::Vector3d& index) {
    const auto& [diagonal, mixed, right, structure, squares, slopes, ends, first_squares, first, first_residual,
                 residual] = products;
    CellSums sums;
    const Eigen::Matrix3d twice{{2.0 * diagonal[0], 1.0 * mixed[0], 1.0 * mixed[1]},
                                {1.0 * mixed[0], 2.0 * diagonal[1], 1.0 * mixed[2]},
                                {1.0 * mixed[1], 1.0 * mixed[2], 2.0 * diagonal[2]}};
    sums.normal = twice / 8;
    sums.right = Eigen::Vector3d(right[0], right[1], right[2]) / 4;
    sums.squares = squares;
    sums.structure = structure / 8.0;
    sums.voxels = voxels;
    sums.contrast.of_gradients << slopes[0], ends[0], slopes[1], ends[1], slopes[2], ends[2];
    sums.contrast.of_gradients /= 4;
    sums.contrast.of_residuals << first_residual, residual;
    sums.contrast.squares = first_squares;
    sums.contrast.sum = first;
    sums.index = index;
    return sums;
}

DenseForces forces_of(const std::vector<CellSums>& own, const CellGrid& cells, const imaging::Geometry& grid,
                      WindowMemory& memory) {
    const std::vector<Spread>& windows = windowed(own, cells, memory);
    return listed_forces(
        cells,
        [&](std::size_t n) {
            return CellCount{own[n].voxels, own[n].normal.trace(), own[n].structure};
        },
        [&](std::size_t n) {
            const Eigen::Vector3d centre = grid.point(own[n].index / own[n].voxels);
            return solved(without_contrast(sums_of(windows[n])), centre, grid);
        });
}

}  // namespace tissuewarp::registration::detail
