#include "registration/matching/blocks/block_cost.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissuewarp::registration::detail {

namespace {

constexpr double nowhere = std::numeric_limits<double>::infinity();
constexpr double full_difference = 255.0 * 255.0 * descriptor_channels;

Voxel corner(const Voxel& centre, int radius) {
    return {centre[0] - radius, centre[1] - radius, centre[2] - radius};
}

struct CorrelationSums {
    double m = 0, f = 0, mm = 0, ff = 0, mf = 0;
    std::int64_t voxels = 0;

    void add(float moving, float fixed) {
        const double a = double(moving), b = double(fixed);
        m += a;
        f += b;
        mm += a * a;
        ff += b * b;
        mf += a * b;
        ++voxels;
    }
    /// A constant block is like none: r = 0.
    [[nodiscard]] double cost() const {
        const double n = double(voxels), variance_m = mm - m * m / n, variance_f = ff - f * f / n;
        const bool flat = variance_m <= 1e-9 * mm || variance_f <= 1e-9 * ff;
        return flat ? 2.0 : 2 * (1 - (mf - m * f / n) / std::sqrt(variance_m * variance_f));
    }
};

bool on_grid(const MatchingImage& image, int j, int k) {
    return j >= 0 && j < image.grid.size[1] && k >= 0 && k < image.grid.size[2];
}

double correlation_cost(const MatchingImage& moving, const MatchingImage& fixed, const Block& block, int stride,
                        const Voxel& at) {
    CorrelationSums sums;
    const int r = block.radius, first = std::max({-r, -block.centre[0], -at[0]}),
              last = std::min({r, moving.grid.size[0] - 1 - block.centre[0], fixed.grid.size[0] - 1 - at[0]});
    for (int dk = first_row(block.radius, stride) - r; dk <= r; dk += stride)
        for (int dj = first_row(block.radius, stride) - r; dj <= r; dj += stride) {
            const Voxel m{block.centre[0] + first, block.centre[1] + dj, block.centre[2] + dk};
            const Voxel f{at[0] + first, at[1] + dj, at[2] + dk};
            if (!on_grid(moving, m[1], m[2]) || !on_grid(fixed, f[1], f[2])) continue;
            auto a = static_cast<std::size_t>(moving.offset(m)), b = static_cast<std::size_t>(fixed.offset(f));
            for (int n = first; n <= last; ++n, ++a, ++b)
                if (moving.seen[a] && fixed.seen[b]) sums.add(moving.values[a], fixed.values[b]);
        }
    return double(sums.voxels) < least_voxels(block.radius, stride, block.least_share) ? nowhere : sums.cost();
}

}  // namespace

BlockCosts::BlockCosts(Surroundings& shown, Surroundings& looked_at, const Block& block)
    : shown_(shown), looked_at_(looked_at), block_(block) {}

CostLattice BlockCosts::lattice(const Voxel& centre, int reach, int stride) {
    CostLattice result{centre, reach, {}};
    const auto side = static_cast<std::size_t>(result.side());
    result.costs.resize(side * side * side);
    if (shown_.image().descriptors)
        descriptor_costs(result, stride);
    else
        correlation_costs(result, stride);
    return result;
}

void BlockCosts::descriptor_costs(CostLattice& lattice, int stride) {
    shown_.cover(block_.centre, block_.radius);
    looked_at_.cover(lattice.centre, block_.radius + lattice.reach);
    const int shifts = lattice.side();
    const RowComparison comparison{2 * block_.radius + 1, first_row(block_.radius, stride), stride, shifts,
                                   descriptor_channels};
    const double least = least_voxels(block_.radius, stride, block_.least_share);
    differences_.resize(static_cast<std::size_t>(shifts));
    voxels_.resize(differences_.size());
    const VoxelRows block = shown_.rows(corner(block_.centre, block_.radius));
    const Voxel first = corner(lattice.centre, block_.radius + lattice.reach);
    double* cost = lattice.costs.data();
    for (int k = 0; k < shifts; ++k)
        for (int j = 0; j < shifts; ++j) {
            squared_differences(block, looked_at_.rows({first[0], first[1] + j, first[2] + k}), comparison,
                                differences_.data(), voxels_.data());
            for (std::size_t i = 0; i < voxels_.size(); ++i)
                *cost++ = double(voxels_[i]) < least ? nowhere
                                                     : double(differences_[i]) / (full_difference * double(voxels_[i]));
        }
}

void BlockCosts::correlation_costs(CostLattice& lattice, int stride) const {
    for (std::size_t n = 0; n < lattice.costs.size(); ++n)
        lattice.costs[n] = correlation_cost(shown_.image(), looked_at_.image(), block_, stride, lattice.place(n));
}

}  // namespace tissuewarp::registration::detail
