#include "registration/detail/dense_force.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace tissuewarp::registration::detail {

namespace {

constexpr int cell_side = 4;               // voxels
constexpr int window_passes = 2;           // of (¼, ½, ¼) along each axis: a window of one cell's deviation
constexpr double independent_share = 0.2;  // of the voxels: descriptors and what they miss agree with those beside them
constexpr double least_square = 1.0;       // of a channel's residual, steps of its eight bits
constexpr double least_deviation = 0.05;   // voxels
constexpr double leakage = 0.05;           // of the strongest axis: what a plane edge seems to show along itself
constexpr double most_shift = 1.5;         // voxels

/// Sums over voxels, in voxels and steps of the descriptors' eight bits.
struct Sums {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();  // A
    Eigen::Vector3d right = Eigen::Vector3d::Zero();   // b
    double squares = 0;                                // Σ (D₁ − D₂)²
    double structure = 0;                              // Σ ½ (|∇D₁|² + |∇D₂|²)
    double voxels = 0;
    Eigen::Vector3d index = Eigen::Vector3d::Zero();  // Σ x, of the cell's own voxels
};

using Channels = std::array<float, descriptor_channels>;

/// Descriptors of a voxel and their central differences.
struct Descriptor {
    Channels value;
    std::array<Channels, 3> gradient;  // per voxel

    Descriptor(const std::uint8_t* at, const std::array<std::ptrdiff_t, 3>& stride) {
        for (std::size_t c = 0; c < descriptor_channels; ++c) value[c] = at[c];
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const std::uint8_t *ahead = at + descriptor_channels * stride[axis],
                               *behind = at - descriptor_channels * stride[axis];
            for (std::size_t c = 0; c < descriptor_channels; ++c)
                gradient[axis][c] = 0.5F * (float(ahead[c]) - float(behind[c]));
        }
    }
};

float dot(const Channels& a, const Channels& b) {
    float sum = 0;
    for (std::size_t c = 0; c < descriptor_channels; ++c) sum += a[c] * b[c];
    return sum;
}

void add(Sums& sums, const Descriptor& first, const Descriptor& second) {
    Channels residual;
    for (std::size_t c = 0; c < descriptor_channels; ++c) residual[c] = first.value[c] - second.value[c];
    for (std::size_t a = 0; a < 3; ++a) {
        const auto row = static_cast<Eigen::Index>(a);
        sums.right[row] += 0.5 * (double(dot(first.gradient[a], residual)) + double(dot(second.gradient[a], residual)));
        sums.structure += 0.5 * (double(dot(first.gradient[a], first.gradient[a])) +
                                 double(dot(second.gradient[a], second.gradient[a])));
        for (std::size_t b = 0; b <= a; ++b) {
            const double product = 0.5 * (double(dot(first.gradient[a], second.gradient[b])) +
                                          double(dot(first.gradient[b], second.gradient[a])));
            const auto column = static_cast<Eigen::Index>(b);
            sums.normal(row, column) += product;
            if (a != b) sums.normal(column, row) += product;
        }
    }
    sums.squares += double(dot(residual, residual));
    sums.voxels += 1;
}

/// Cells of a grid: the voxels that have neighbours on all sides, by cubes.
class Cells {
public:
    explicit Cells(const imaging::Geometry& grid) : cells_(grid) {
        for (int& size : cells_.size) size = std::max(1, (size - 2 + cell_side - 1) / cell_side);
        cells_.origin = grid.point(Eigen::Vector3d::Constant(1 + 0.5 * (cell_side - 1)));
        cells_.spacing *= cell_side;
        stride_ = {1, cells_.size[0], std::ptrdiff_t{cells_.size[0]} * cells_.size[1]};
    }

    [[nodiscard]] const imaging::Geometry& grid() const { return cells_; }
    [[nodiscard]] std::size_t count() const { return static_cast<std::size_t>(cells_.voxel_count()); }
    [[nodiscard]] std::ptrdiff_t stride(std::size_t axis) const { return stride_[axis]; }
    [[nodiscard]] Voxel cell(std::size_t n) const {
        const auto place = static_cast<std::ptrdiff_t>(n);
        return {static_cast<int>(place % stride_[1]), static_cast<int>(place % stride_[2] / stride_[1]),
                static_cast<int>(place / stride_[2])};
    }

private:
    imaging::Geometry cells_;
    std::array<std::ptrdiff_t, 3> stride_{};
};

/// The sums of a cell's own voxels.
Sums sums_of(const Voxel& cell, const MatchingImage& first, const MatchingImage& second,
             const std::vector<std::uint8_t>& counts) {
    const auto& size = first.grid.size;
    const std::array<std::ptrdiff_t, 3> stride{1, size[0], std::ptrdiff_t{size[0]} * size[1]};
    const auto shown = [&](std::ptrdiff_t n) {
        return first.seen[static_cast<std::size_t>(n)] && second.seen[static_cast<std::size_t>(n)];
    };
    const auto range = [&](std::size_t axis) {
        const int start = 1 + cell[axis] * cell_side;
        return Range{start, std::min(start + cell_side, size[axis] - 1)};
    };
    Sums sums;
    for (int k = range(2).first; k < range(2).last; ++k)
        for (int j = range(1).first; j < range(1).last; ++j)
            for (int i = range(0).first; i < range(0).last; ++i) {
                const std::ptrdiff_t n = first.offset({i, j, k});
                if (!counts[static_cast<std::size_t>(n)] || !shown(n)) continue;
                if (!std::all_of(stride.begin(), stride.end(), [&](auto s) { return shown(n - s) && shown(n + s); }))
                    continue;
                add(sums, Descriptor(first.descriptors.get() + descriptor_channels * n, stride),
                    Descriptor(second.descriptors.get() + descriptor_channels * n, stride));
                sums.index += Eigen::Vector3d(i, j, k);
            }
    return sums;
}

/// Spreads each cell's sums over its window; their total stays, but for what leaves the grid.
std::vector<Sums> windowed(std::vector<Sums> sums, const Cells& cells) {
    for (int pass = 0; pass < window_passes; ++pass)
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const std::vector<Sums> from = sums;
            tbb::parallel_for(std::size_t{0}, sums.size(), [&](std::size_t n) {
                Sums& to = sums[n];
                const auto take = [&](std::ptrdiff_t step, double weight) {
                    const Sums& other = from[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(n) + step)];
                    to.normal += weight * other.normal;
                    to.right += weight * other.right;
                    to.squares += weight * other.squares;
                    to.voxels += weight * other.voxels;
                };
                const Eigen::Vector3d index = to.index;
                to = {};
                to.index = index;
                take(0, 0.5);
                const int at = cells.cell(n)[axis];
                if (at > 0) take(-cells.stride(axis), 0.25);
                if (at + 1 < cells.grid().size[axis]) take(cells.stride(axis), 0.25);
            });
        }
    return sums;
}

/// Shift and information along the axes of A, voxels.
std::optional<DenseForce> solved(const Sums& window, const imaging::Geometry& grid) {
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
    return DenseForce{{}, turn * shift * h, turn * (information / (h * h)).asDiagonal() * turn.transpose()};
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
    const Cells cells(first.grid);
    std::vector<Sums> own(cells.count());
    tbb::parallel_for(std::size_t{0}, own.size(),
                      [&](std::size_t n) { own[n] = sums_of(cells.cell(n), first, second, counts); });
    const std::vector<Sums> windows = windowed(own, cells);
    DenseForces result{{}, cells.grid(), std::vector<std::uint8_t>(own.size()), 0};
    double common = 0, structure = 0;
    for (std::size_t n = 0; n < own.size(); ++n) {
        common += own[n].normal.trace();
        structure += own[n].structure;
        if (own[n].voxels < 1) continue;
        std::optional<DenseForce> force = solved(windows[n], first.grid);
        if (!force) continue;
        force->place = first.grid.point(own[n].index / own[n].voxels);
        result.said[n] = 1;
        result.forces.push_back(*force);
    }
    if (structure > 0) result.agreement = common / structure;
    return result;
}

}  // namespace tissuewarp::registration::detail
