#include "registration/detail/block_cost.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissuewarp::registration::detail {

namespace {

constexpr double nowhere = std::numeric_limits<double>::infinity();

/// Squared differences of bytes; at most 255 voxels of 12 channels, which fit into 32 bits.
int squared_difference(const std::uint8_t* a, const std::uint8_t* b, int count) {
    int sum = 0;
    for (int n = 0; n < count; ++n) {
        const int difference = int{a[n]} - int{b[n]};
        sum += difference * difference;
    }
    return sum;
}

struct DescriptorSums {
    const MatchingImage &moving, &fixed;
    std::int64_t sum = 0, voxels = 0;

    void add(std::int64_t m, std::int64_t f, int count) {
        sum += squared_difference(&moving.descriptors[static_cast<std::size_t>(m * descriptor_channels)],
                                  &fixed.descriptors[static_cast<std::size_t>(f * descriptor_channels)],
                                  count * descriptor_channels);
        voxels += count;
    }
    [[nodiscard]] double cost() const { return double(sum) / (255.0 * 255.0 * descriptor_channels * double(voxels)); }
};

struct CorrelationSums {
    const MatchingImage &moving, &fixed;
    double m = 0, f = 0, mm = 0, ff = 0, mf = 0;
    std::int64_t voxels = 0;

    void add(std::int64_t at_m, std::int64_t at_f, int count) {
        for (int n = 0; n < count; ++n) {
            const double a = double(moving.values[static_cast<std::size_t>(at_m + n)]);
            const double b = double(fixed.values[static_cast<std::size_t>(at_f + n)]);
            m += a;
            f += b;
            mm += a * a;
            ff += b * b;
            mf += a * b;
        }
        voxels += count;
    }
    /// A constant block is like none: r = 0.
    [[nodiscard]] double cost() const {
        const double n = double(voxels), variance_m = mm - m * m / n, variance_f = ff - f * f / n;
        const bool flat = variance_m <= 1e-9 * mm || variance_f <= 1e-9 * ff;
        return flat ? 2.0 : 2 * (1 - (mf - m * f / n) / std::sqrt(variance_m * variance_f));
    }
};

/// Adds a row of `count` voxels, whole where both images see it and voxel by voxel where they do not.
template <class Sums>
void add_row(Sums& sums, std::int64_t m, std::int64_t f, int count) {
    const std::uint8_t *run_m = &sums.moving.seen_run[static_cast<std::size_t>(m)],
                       *run_f = &sums.fixed.seen_run[static_cast<std::size_t>(f)];
    if (std::min(run_m[0], run_f[0]) >= count) {
        sums.add(m, f, count);
        return;
    }
    for (int n = 0; n < count; ++n)
        if (run_m[n] && run_f[n]) sums.add(m + n, f + n, 1);
}

/// Offsets from the centre of a block, along one axis, that stay in both grids.
struct Span {
    int first, last;
    Span(const Block& block, const MatchingImage& moving, const MatchingImage& fixed, const Voxel& at, std::size_t axis)
        : first(std::max({-block.radius, -block.centre[axis], -at[axis]})),
          last(std::min(
              {block.radius, moving.grid.size[axis] - 1 - block.centre[axis], fixed.grid.size[axis] - 1 - at[axis]})) {}
};

template <class Sums>
double cost_of(Sums sums, const Block& block, const Voxel& at) {
    const Span i(block, sums.moving, sums.fixed, at, 0), j(block, sums.moving, sums.fixed, at, 1),
        k(block, sums.moving, sums.fixed, at, 2);
    if (i.first > i.last) return nowhere;
    for (int dk = k.first; dk <= k.last; dk += block.stride)
        for (int dj = j.first; dj <= j.last; dj += block.stride)
            add_row(sums, sums.moving.offset({block.centre[0] + i.first, block.centre[1] + dj, block.centre[2] + dk}),
                    sums.fixed.offset({at[0] + i.first, at[1] + dj, at[2] + dk}), i.last - i.first + 1);
    const int side = 2 * block.radius + 1, rows = (side + block.stride - 1) / block.stride;
    const double all = double(side) * rows * rows;
    return double(sums.voxels) < std::max(1.0, block.least_share * all) ? nowhere : sums.cost();
}

}  // namespace

double block_cost(const MatchingImage& moving, const MatchingImage& fixed, const Block& block, const Voxel& at) {
    if (!moving.descriptors.empty()) return cost_of(DescriptorSums{moving, fixed}, block, at);
    return cost_of(CorrelationSums{moving, fixed}, block, at);
}

CostLattice cost_lattice(const MatchingImage& moving, const MatchingImage& fixed, const Block& block,
                         const Voxel& centre, int reach) {
    CostLattice lattice{centre, reach, {}};
    const auto side = static_cast<std::size_t>(lattice.side());
    lattice.costs.resize(side * side * side);
    for (std::size_t n = 0; n < lattice.costs.size(); ++n) {
        const Voxel d = lattice.displacement(n);
        lattice.costs[n] = block_cost(moving, fixed, block, {centre[0] + d[0], centre[1] + d[1], centre[2] + d[2]});
    }
    return lattice;
}

}  // namespace tissuewarp::registration::detail
