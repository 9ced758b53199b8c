#pragma once
/// Costs over a cube of places.

#include "registration/matching/descriptors/matching_image.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace tissuewarp::registration::detail {

struct Block {
    Voxel centre{0, 0, 0};     ///< voxel of the moving grid
    int radius = 4;            ///< voxels: the block has 2 radius + 1 along each axis
    double least_share = 0.5;  ///< of its voxels, that must be seen in both images
};

/// The first of every `stride`-th row, from the edge of the block: as many are left out at its other edge, if it can
/// be.
constexpr int first_row(int radius, int stride) {
    return 2 * radius % stride / 2;
}

/// Fewest voxels that must count of those that every `stride`-th row of a block holds.
inline double least_voxels(int radius, int stride, double least_share) {
    const int side = 2 * radius + 1, rows = (side + stride - 1) / stride;
    return std::max(1.0, least_share * double(side) * rows * rows);
}

/// Costs on the cube of ± reach voxels about a centre, i fastest.
struct CostLattice {
    Voxel centre{0, 0, 0};
    int reach = 0;
    std::vector<double> costs;

    [[nodiscard]] int side() const { return 2 * reach + 1; }
    /// Displacement from the centre, voxels.
    [[nodiscard]] Voxel displacement(std::size_t n) const {
        const int m = static_cast<int>(n), s = side();
        return {m % s - reach, m / s % s - reach, m / (s * s) - reach};
    }
    /// The voxel of an entry.
    [[nodiscard]] Voxel place(std::size_t n) const {
        const Voxel d = displacement(n);
        return {centre[0] + d[0], centre[1] + d[1], centre[2] + d[2]};
    }
    /// At a voxel within the lattice.
    [[nodiscard]] double cost(const Voxel& at) const {
        const int i = at[0] - centre[0] + reach, j = at[1] - centre[1] + reach, k = at[2] - centre[2] + reach;
        return costs[static_cast<std::size_t>(i + side() * (j + side() * k))];
    }
    /// The lowest place; none when nothing of it is seen.
    [[nodiscard]] std::optional<Voxel> lowest() const {
        const auto least = std::min_element(costs.begin(), costs.end());
        if (!std::isfinite(*least)) return std::nullopt;
        return place(static_cast<std::size_t>(least - costs.begin()));
    }
};

}  // namespace tissuewarp::registration::detail
