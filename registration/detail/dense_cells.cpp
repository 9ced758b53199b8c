#include "registration/detail/dense_cells.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>

namespace tissuewarp::registration::detail {

namespace {

constexpr double independent_share = 0.2;  // of the voxels: descriptors and what they miss agree with those beside them
constexpr double least_square = 1.0;       // of a channel's residual, steps of its eight bits
constexpr double least_deviation = 0.05;   // voxels
constexpr double leakage = 0.05;           // of the strongest axis: what a plane edge seems to show along itself
constexpr double most_shift = 1.5;         // voxels

/// What of sums is spread: A (00, 11, 22, 01, 02, 12), b, squares and voxels.
using Spread = Eigen::Array<double, 11, 1>;

Spread spread_of(const CellSums& sums) {
    const auto& A = sums.normal;
    Spread result;
    result << A(0, 0), A(1, 1), A(2, 2), A(0, 1), A(0, 2), A(1, 2), sums.right, sums.squares, sums.voxels;
    return result;
}

CellSums sums_of(const Spread& s) {
    CellSums result;
    result.normal << s[0], s[3], s[4], s[3], s[1], s[5], s[4], s[5], s[2];
    result.right = s.segment<3>(6);
    result.squares = s[9];
    result.voxels = s[10];
    return result;
}

/// Spreads each cell's sums over a window of one cell's deviation, (1, 4, 6, 4, 1)/16 along each axis; their total
/// stays, but for what leaves the grid.
std::vector<Spread> windowed(const std::vector<CellSums>& sums, const CellGrid& cells) {
    constexpr std::array<double, 3> weights{6.0 / 16, 4.0 / 16, 1.0 / 16};
    std::vector<Spread> from(sums.size()), to(sums.size());
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

/// Shift and information along the axes of A, voxels.
std::optional<DenseForce> solved(const CellSums& window, const Eigen::Vector3d& place, const imaging::Geometry& grid) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(window.normal);
    const Eigen::Array3d strength = axes.eigenvalues();
    const double variance = std::max(window.squares / window.voxels, descriptor_channels * least_square);
    const Eigen::Array3d raw = (independent_share / variance * (strength - leakage * strength[2])).max(0.0);
    if (!(raw[2] > 0)) return std::nullopt;
    const Eigen::Array3d along = axes.eigenvectors().transpose() * window.right;
    Eigen::Vector3d shift = (raw > 0).select(along / strength, 0.0);
    if (const double length = shift.norm(); length > most_shift) shift *= most_shift / length;
    const Eigen::Vector3d information = raw / (1 + raw * least_deviation * least_deviation);
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
    const auto& [diagonal, mixed, right, structure, squares] = products;
    CellSums sums;
    const Eigen::Matrix3d twice{{2.0 * diagonal[0], 1.0 * mixed[0], 1.0 * mixed[1]},
                                {1.0 * mixed[0], 2.0 * diagonal[1], 1.0 * mixed[2]},
                                {1.0 * mixed[1], 1.0 * mixed[2], 2.0 * diagonal[2]}};
    sums.normal = twice / 8;
    sums.right = Eigen::Vector3d(right[0], right[1], right[2]) / 4;
    sums.squares = squares;
    sums.structure = structure / 8.0;
    sums.voxels = voxels;
    sums.index = index;
    return sums;
}

DenseForces forces_of(const std::vector<CellSums>& own, const CellGrid& cells, const imaging::Geometry& grid) {
    const std::vector<Spread> windows = windowed(own, cells);
    DenseForces result{{}, cells.centres(), std::vector<std::uint8_t>(own.size()), 0};
    std::vector<DenseForce> forces(own.size());
    tbb::parallel_for(std::size_t{0}, own.size(), [&](std::size_t n) {
        if (own[n].voxels < 1) return;
        const Eigen::Vector3d place = grid.point(own[n].index / own[n].voxels);
        const std::optional<DenseForce> force = solved(sums_of(windows[n]), place, grid);
        if (!force) return;
        forces[n] = *force;
        result.said[n] = 1;
    });
    double common = 0, structure = 0;
    result.forces.reserve(static_cast<std::size_t>(std::count(result.said.begin(), result.said.end(), 1)));
    for (std::size_t n = 0; n < own.size(); ++n) {
        common += own[n].normal.trace();
        structure += own[n].structure;
        if (result.said[n]) result.forces.push_back(forces[n]);
    }
    if (structure > 0) result.agreement = common / structure;
    return result;
}

}  // namespace tissuewarp::registration::detail
