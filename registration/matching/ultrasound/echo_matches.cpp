#include "registration/matching/ultrasound/echo_matches.hpp"

#include "registration/matching/blocks/cost_minimum.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace tissuewarp::registration::detail {

namespace {

constexpr double least_cost = 1e-3;

/// Over the window, mm³: of samples that a Gaussian of this deviation weighs alike.
double window_volume(double window_mm) {
    return std::pow(4 * EIGEN_PI * window_mm * window_mm, 1.5);
}

/// What has been chosen of each place, and how much it counts.
struct Choice {
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();  // steps
    double weight = 0;
};

class Choosing {
public:
    Choosing(const EchoCosts& costs, double window_mm, const EchoInformation& rules)
        : costs_(costs),
          rules_(rules),
          independent_(window_volume(window_mm) / rules.independent_mm3),
          surprise_(costs.cost.size()) {
        tbb::parallel_for(std::size_t{0}, costs_.at.size(), [&](std::size_t n) {
            for (std::size_t entry = 0; entry < costs_.lattice(); ++entry)
                surprise_[n * costs_.lattice() + entry] = surprise(n, costs_.of(n)[entry]);
        });
    }

    std::vector<Choice> choices() const {
        std::vector<Choice> chosen(costs_.at.size());
        tbb::parallel_for(std::size_t{0}, chosen.size(), [&](std::size_t n) { chosen[n] = choice(n, std::nullopt); });
        for (int round = 0; round < rules_.story_rounds; ++round) {
            const std::vector<std::optional<Eigen::Vector3d>> story = stories(chosen);
            tbb::parallel_for(std::size_t{0}, chosen.size(), [&](std::size_t n) { chosen[n] = choice(n, story[n]); });
        }
        return chosen;
    }

    /// The force of a place that chose a shift.
    [[nodiscard]] std::optional<DenseForce> force(std::size_t n, const Eigen::Vector3d& shift) const {
        const auto near = about(n, shift);
        if (!near) return std::nullopt;
        const auto minimum = minimum_of(*near);
        if (!minimum) return std::nullopt;
        const double h = costs_.step_mm;
        const Eigen::Matrix3d raw =
            independent_ * costs_.window_share[n] / (2 * std::max(minimum->cost, least_cost)) * minimum->fit.hessian;
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
        axes.computeDirect(raw);
        const double leakage = rules_.leakage * axes.eigenvalues()[2];
        const Eigen::Array3d strength = (axes.eigenvalues().array() - leakage).max(0.0);
        if (!(strength[2] > 0)) return std::nullopt;
        const double own = costs_.places.voxel_volume() / rules_.independent_mm3 / independent_;
        const Eigen::Vector3d information =
            own * strength / (1 + strength * rules_.least_deviation * rules_.least_deviation) / (h * h);
        const Eigen::Matrix3d turn = costs_.places.direction * axes.eigenvectors();
        return DenseForce{costs_.place(n), costs_.places.direction * (h * minimum->index()),
                          turn * information.asDiagonal() * turn.transpose()};
    }

private:
    const EchoCosts& costs_;
    const EchoInformation& rules_;
    double independent_;            // samples in a window
    std::vector<double> surprise_;  // of each place, of each shift

    /// −log likelihood of a shift of this cost, but for a constant: the residuals' variance is what the best fit
    /// leaves.
    [[nodiscard]] double surprise(std::size_t n, float cost) const {
        if (!std::isfinite(cost)) return std::numeric_limits<double>::infinity();
        return 0.5 * independent_ * costs_.window_share[n] * std::log(std::max<double>(cost, least_cost));
    }

    [[nodiscard]] Choice choice(std::size_t n, const std::optional<Eigen::Vector3d>& story) const {
        const double per_step2 = std::pow(costs_.step_mm / rules_.story_deviation_mm, 2);
        double least = std::numeric_limits<double>::infinity();
        std::vector<double> surprises(costs_.lattice());
        for (std::size_t entry = 0; entry < surprises.size(); ++entry) {
            double value = surprise_[n * surprises.size() + entry];
            if (story) value += 0.5 * per_step2 * (costs_.shift(entry).cast<double>() - *story).squaredNorm();
            surprises[entry] = value;
            least = std::min(least, value);
        }
        if (!std::isfinite(least)) return {};
        Choice mean;
        double squares = 0;
        for (std::size_t entry = 0; entry < surprises.size(); ++entry) {
            const double p = std::exp(least - surprises[entry]);
            const Eigen::Vector3d shift = costs_.shift(entry).cast<double>();
            mean.weight += p;
            mean.shift += p * shift;
            squares += p * shift.squaredNorm();
        }
        mean.shift /= mean.weight;
        const double variance = squares / mean.weight - mean.shift.squaredNorm();
        mean.weight = 1 / (variance + 0.25);
        return mean;
    }

    /// What the places around each one chose.
    [[nodiscard]] std::vector<std::optional<Eigen::Vector3d>> stories(const std::vector<Choice>& chosen) const {
        const double reach = rules_.story_mm / costs_.places.spacing[0];
        std::vector<Eigen::Vector4d> grid(static_cast<std::size_t>(costs_.places.voxel_count()),
                                          Eigen::Vector4d::Zero());
        for (std::size_t n = 0; n < chosen.size(); ++n)
            grid[costs_.at[n]] << chosen[n].weight * chosen[n].shift, chosen[n].weight;
        smooth(grid, reach);
        std::vector<std::optional<Eigen::Vector3d>> result(chosen.size());
        for (std::size_t n = 0; n < chosen.size(); ++n)
            if (const Eigen::Vector4d& sum = grid[costs_.at[n]]; sum[3] > 0) result[n] = sum.head<3>() / sum[3];
        return result;
    }

    void smooth(std::vector<Eigen::Vector4d>& grid, double deviation) const {
        const int radius = std::max(1, static_cast<int>(std::lround(2 * deviation)));
        std::vector<double> weights;
        for (int d = -radius; d <= radius; ++d) weights.push_back(std::exp(-0.5 * d * d / (deviation * deviation)));
        const auto& size = costs_.places.size;
        const std::array<std::ptrdiff_t, 3> stride{1, size[0], std::ptrdiff_t{size[0]} * size[1]};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const std::vector<Eigen::Vector4d> from = grid;
            tbb::parallel_for(std::size_t{0}, grid.size(), [&](std::size_t n) {
                const int at = static_cast<int>(static_cast<std::ptrdiff_t>(n) / stride[axis] % size[axis]);
                Eigen::Vector4d sum = Eigen::Vector4d::Zero();
                for (int d = std::max(-radius, -at); d <= std::min(radius, size[axis] - 1 - at); ++d)
                    sum += weights[static_cast<std::size_t>(d + radius)] *
                           from[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(n) + d * stride[axis])];
                grid[n] = sum;
            });
        }
    }

    /// The 27 costs about the lowest place downhill of a shift; none at the rim of the lattice.
    [[nodiscard]] std::optional<CostLattice> about(std::size_t n, const Eigen::Vector3d& shift) const {
        constexpr int most_steps = 3;
        Voxel at{};
        for (std::size_t a = 0; a < 3; ++a) at[a] = static_cast<int>(std::lround(shift[static_cast<Eigen::Index>(a)]));
        for (int step = 0; step <= most_steps; ++step) {
            const auto near = lattice_about(n, at);
            if (!near) return std::nullopt;
            const auto lowest = near->lowest();
            if (!lowest) return std::nullopt;
            if (!(near->cost(*lowest) < near->cost(at))) return near;
            at = *lowest;
        }
        return std::nullopt;
    }

    [[nodiscard]] std::optional<CostLattice> lattice_about(std::size_t n, const Voxel& at) const {
        CostLattice near{at, 1, {}};
        const int side = costs_.side(), reach = costs_.reach;
        if (std::any_of(at.begin(), at.end(), [&](int x) { return std::abs(x) >= reach; })) return std::nullopt;
        for (int k = -1; k <= 1; ++k)
            for (int j = -1; j <= 1; ++j)
                for (int i = -1; i <= 1; ++i) {
                    const int entry = at[0] + i + reach + side * (at[1] + j + reach + side * (at[2] + k + reach));
                    near.costs.push_back(costs_.of(n)[entry]);
                }
        return near;
    }
};

/// 0 where no shift at all explains more than the mean of all shifts does, 1 where it explains everything.
double agreement_of(const EchoCosts& costs) {
    const std::size_t middle = costs.lattice() / 2;
    double chance = 0, left = 0;
    for (std::size_t n = 0; n < costs.at.size(); ++n) {
        double sum = 0;
        int count = 0;
        for (std::size_t entry = 0; entry < costs.lattice(); ++entry)
            if (std::isfinite(costs.of(n)[entry])) {
                sum += costs.of(n)[entry];
                ++count;
            }
        if (!std::isfinite(costs.of(n)[middle])) continue;
        chance += sum / count;
        left += costs.of(n)[middle];
    }
    return chance > 0 ? 1 - left / chance : 0;
}

}  // namespace

EchoMatches echo_matches(const EchoCosts& costs, double window_mm, const EchoInformation& rules) {
    const Choosing choosing(costs, window_mm, rules);
    const std::vector<Choice> chosen = choosing.choices();
    std::vector<std::optional<DenseForce>> found(chosen.size());
    tbb::parallel_for(std::size_t{0}, chosen.size(), [&](std::size_t n) {
        if (chosen[n].weight > 0) found[n] = choosing.force(n, chosen[n].shift);
    });
    EchoMatches result;
    for (const auto& force : found)
        if (force) result.forces.push_back(*force);
    result.agreement = agreement_of(costs);
    return result;
}

}  // namespace tissuewarp::registration::detail
