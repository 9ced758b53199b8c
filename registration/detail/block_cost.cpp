#include "registration/detail/block_cost.hpp"

#include "registration/detail/block_window.hpp"

#include <cmath>
#include <limits>

namespace tissuewarp::registration::detail {

namespace {

constexpr double nowhere = std::numeric_limits<double>::infinity();
constexpr double squared_range = 255.0 * 255.0;

/// Voxels that the rows of a block hold when all are seen.
double voxels_of(const Block& block) {
    const int side = 2 * block.radius + 1, rows = (side + block.stride - 1) / block.stride;
    return double(side) * rows * rows;
}

/// Rows of costs along i, for the places (j, k) of a lattice of descriptors.
class DescriptorCosts {
public:
    DescriptorCosts(const MatchingImage& moving, const MatchingImage& fixed, const Block& block, const Voxel& centre,
                    int reach)
        : least_(std::max(1.0, block.least_share * voxels_of(block)) * descriptor_channels),
          all_(voxels_of(block) * descriptor_channels),
          block_(moving, corner(block.centre, block.radius), 2 * block.radius + 1),
          window_(fixed, corner(centre, block.radius + reach), 2 * (block.radius + reach) + 1),
          comparison_{2 * block.radius + 1, block.stride, (2 * block.radius + 1) * descriptor_channels, 2 * reach + 1,
                      descriptor_channels},
          differences_(static_cast<std::size_t>(2 * reach + 1)),
          counts_(differences_.size()) {}

    void row(int j, int k, double* costs) {
        if (block_.whole() && window_.whole())
            whole_squared_differences(block_.rows(0, 0), window_.rows(j, k), comparison_, differences_.data());
        else
            masked_squared_differences(block_.rows(0, 0), window_.rows(j, k), comparison_, differences_.data(),
                                       counts_.data());
        for (std::size_t i = 0; i < differences_.size(); ++i) {
            const double count = window_.whole() && block_.whole() ? all_ : double(counts_[i]) / squared_range;
            costs[i] = count < least_ ? nowhere : double(differences_[i]) / (squared_range * count);
        }
    }

private:
    double least_, all_;  // bytes
    BlockWindow block_, window_;
    RowComparison comparison_;
    std::vector<std::int64_t> differences_, counts_;

    static Voxel corner(const Voxel& centre, int radius) {
        return {centre[0] - radius, centre[1] - radius, centre[2] - radius};
    }
};

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

double correlation_cost(const MatchingImage& moving, const MatchingImage& fixed, const Block& block, const Voxel& at) {
    CorrelationSums sums;
    const int r = block.radius, first = std::max({-r, -block.centre[0], -at[0]}),
              last = std::min({r, moving.grid.size[0] - 1 - block.centre[0], fixed.grid.size[0] - 1 - at[0]});
    for (int dk = -r; dk <= r; dk += block.stride)
        for (int dj = -r; dj <= r; dj += block.stride) {
            const Voxel m{block.centre[0] + first, block.centre[1] + dj, block.centre[2] + dk};
            const Voxel f{at[0] + first, at[1] + dj, at[2] + dk};
            if (!on_grid(moving, m[1], m[2]) || !on_grid(fixed, f[1], f[2])) continue;
            auto a = static_cast<std::size_t>(moving.offset(m)), b = static_cast<std::size_t>(fixed.offset(f));
            for (int n = first; n <= last; ++n, ++a, ++b)
                if (moving.seen[a] && fixed.seen[b]) sums.add(moving.values[a], fixed.values[b]);
        }
    return double(sums.voxels) < std::max(1.0, block.least_share * voxels_of(block)) ? nowhere : sums.cost();
}

}  // namespace

CostLattice cost_lattice(const MatchingImage& moving, const MatchingImage& fixed, const Block& block,
                         const Voxel& centre, int reach) {
    CostLattice lattice{centre, reach, {}};
    const int side = lattice.side();
    lattice.costs.resize(static_cast<std::size_t>(side) * side * side);
    if (!moving.descriptors) {
        for (std::size_t n = 0; n < lattice.costs.size(); ++n) {
            const Voxel d = lattice.displacement(n);
            lattice.costs[n] =
                correlation_cost(moving, fixed, block, {centre[0] + d[0], centre[1] + d[1], centre[2] + d[2]});
        }
        return lattice;
    }
    DescriptorCosts costs(moving, fixed, block, centre, reach);
    double* row = lattice.costs.data();
    for (int k = 0; k < side; ++k)
        for (int j = 0; j < side; ++j, row += side) costs.row(j, k, row);
    return lattice;
}

}  // namespace tissuewarp::registration::detail
