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
    constexpr std::array<double, 3> weights{6.0 / 16, 4.0 / 16, 1.0 / 16};
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

/// Cells with voxels that count, row by row along i.
class RowsOfCells {
public:
    RowsOfCells(const std::vector<CellSums>& own, const CellGrid& cells)
        : own_(own), length_(static_cast<std::size_t>(cells.stride(1))), rows_(own.size() / length_) {
        tbb::parallel_for(std::size_t{0}, rows_.size(), [&](std::size_t row) {
            Row& sum = rows_[row];
            for (std::size_t n = row * length_; n < (row + 1) * length_; ++n) {
                if (own[n].voxels < 1) continue;
                ++sum.counted;
                sum.common += own[n].normal.trace();
                sum.structure += own[n].structure;
            }
        });
        for (Row& row : rows_) {
            row.first = counted_;
            counted_ += row.counted;
        }
    }

    [[nodiscard]] std::size_t counted() const { return counted_; }

    [[nodiscard]] double agreement() const {
        double common = 0, structure = 0;
        for (const Row& row : rows_) {
            common += row.common;
            structure += row.structure;
        }
        return structure > 0 ? common / structure : 0;
    }

    /// visit(cell, its place among those that count), from any thread.
    template <class Visit>
    void for_each_counted(const Visit& visit) const {
        tbb::parallel_for(std::size_t{0}, rows_.size(), [&](std::size_t row) {
            std::size_t place = rows_[row].first;
            for (std::size_t n = row * length_; n < (row + 1) * length_; ++n)
                if (own_[n].voxels >= 1) visit(n, place++);
        });
    }

    /// Those without a force leave the list, which is that of all that count.
    void drop_silent(DenseForces& forces) const {
        std::vector<char> silent(counted_);
        for_each_counted([&](std::size_t n, std::size_t place) { silent[place] = !forces.said[n]; });
        if (std::find(silent.begin(), silent.end(), char{1}) == silent.end()) return;
        std::size_t place = 0;
        std::erase_if(forces.forces, [&](const DenseForce&) { return silent[place++] != 0; });
    }

private:
    struct Row {
        std::size_t counted = 0, first = 0;
        double common = 0, structure = 0;  // CellSums: Σ tr A, Σ structure
    };

    const std::vector<CellSums>& own_;
    std::size_t length_;
    std::vector<Row> rows_;
    std::size_t counted_ = 0;
};

/// Takes out of A, b and the squares what D₂ = D₁ − (D₁, 1) c explains of them, c the same for all channels.
CellSums without_contrast(CellSums window) {
    const ContrastSums& contrast = window.contrast;
    const double samples = descriptor_channels * window.voxels;
    Eigen::Matrix2d common;
    common << contrast.squares + least_square * samples, contrast.sum, contrast.sum, samples;
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
    const RowsOfCells rows(own, cells);
    DenseForces result{std::vector<DenseForce>(rows.counted()), cells.centres(), std::vector<std::uint8_t>(own.size()),
                       rows.agreement()};
    rows.for_each_counted([&](std::size_t n, std::size_t place) {
        const Eigen::Vector3d centre = grid.point(own[n].index / own[n].voxels);
        const std::optional<DenseForce> force = solved(without_contrast(sums_of(windows[n])), centre, grid);
        if (!force) return;
        result.forces[place] = *force;
        result.said[n] = 1;
    });
    rows.drop_silent(result);
    return result;
}

}  // namespace tissuewarp::registration::detail
