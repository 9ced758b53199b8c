#include "registration/terms/term.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace tissuewarp::registration::detail {

void add(Contribution& sum, Contribution more) {
    std::move(more.springs.begin(), more.springs.end(), std::back_inserter(sum.springs));
    if (sum.forces.cols() == 0)
        sum.forces = std::move(more.forces);
    else if (more.forces.cols() > 0)
        sum.forces += more.forces;
    sum.pulls_anew |= more.pulls_anew;
    const int matched = sum.matched + more.matched;
    if (matched > 0)
        sum.mean_residual_mm = (sum.matched * sum.mean_residual_mm + more.matched * more.mean_residual_mm) / matched;
    sum.matched = matched;
    sum.candidates += more.candidates;
    sum.held_back += more.held_back;
}

std::vector<PulledNode> pulled_by(Origin origin, const std::vector<tled::Spring>& springs) {
    std::vector<PulledNode> result;
    result.reserve(springs.size());
    for (const tled::Spring& spring : springs) result.push_back({spring, origin});
    return result;
}

std::vector<PulledNode> pulled_by(const DatumKind& kind, const std::vector<tled::Spring>& springs) {
    std::vector<PulledNode> result = pulled_by(Origin::Datum, springs);
    for (PulledNode& pulled : result) {
        pulled.shared_mm = kind.shared_mm;
        pulled.shows_mm = kind.shows_mm;
    }
    return result;
}

Alignment Term::pose(const Eigen::Isometry3d& start, Observer& /*observer*/) {
    return {start, 0};
}

double FallingScale::of(const RoundPlan& plan, double final_mm) const {
    return plan.last ? final_mm : std::max(final_mm, first_mm_ * std::pow(robust_rounds.falling, plan.number));
}

}  // namespace tissuewarp::registration::detail
