#include "registration/matching/blocks/cost_minimum.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace tissuewarp::registration::detail {

std::optional<Minimum> minimum_of(const CostLattice& near) {
    std::array<double, 27> about{};
    std::copy(near.costs.begin(), near.costs.end(), about.begin());
    const auto fit = fit_quadratic(about);
    if (!fit) return std::nullopt;
    return Minimum{near.centre, about[13], *fit};
}

double uniqueness(const CostLattice& lattice, const Minimum& minimum) {
    double total = 0;
    int count = 0;
    for (const double cost : lattice.costs)
        if (std::isfinite(cost)) {
            total += cost - minimum.cost;
            ++count;
        }
    const double mean_rise = total / std::max(count, 1);
    double least = 0;
    bool found = false;
    for (std::size_t n = 0; n < lattice.costs.size(); ++n) {
        if (!std::isfinite(lattice.costs[n])) continue;
        const double rise = lattice.costs[n] - minimum.cost;
        if (found && rise >= least) continue;
        const Eigen::Vector3d away = as_vector(lattice.place(n)) - as_vector(minimum.at);
        if (0.5 * away.dot(minimum.fit.hessian * away) <= mean_rise) continue;
        least = rise;
        found = true;
    }
    return found && mean_rise > 0 ? std::clamp(least / mean_rise, 0.0, 1.0) : 0.0;
}

}  // namespace tissuewarp::registration::detail
