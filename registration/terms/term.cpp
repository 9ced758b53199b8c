#include "registration/terms/term.hpp"

namespace tissuewarp::registration::detail {

void add(Contribution& sum, Contribution more) {
    auto& springs = sum.conditions.springs;
    springs.insert(springs.end(), more.conditions.springs.begin(), more.conditions.springs.end());
    sum.holds.insert(sum.holds.end(), more.holds.begin(), more.holds.end());
    const int matched = sum.matched + more.matched;
    if (matched > 0)
        sum.mean_residual_mm = (sum.matched * sum.mean_residual_mm + more.matched * more.mean_residual_mm) / matched;
    sum.matched = matched;
    sum.candidates += more.candidates;
    sum.held_back += more.held_back;
}

}  // namespace tissuewarp::registration::detail
