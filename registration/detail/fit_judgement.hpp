#pragma once
/// Which of the estimated parameters the data tell.

#include "registration/detail/fit_search.hpp"

namespace tissuewarp::registration::detail {

/// Writes values, deviations and verdicts on the active scalars to `results` and returns those that the data tell. What
/// several reasons speak against is left for one of them: without it the others are to be estimated anew. Criteria:
/// docs/decisions/parameter_fits.md.
std::vector<std::size_t> told_by_data(const std::vector<FitScalar>& scalars, const std::vector<std::size_t>& active,
                                      const FitEstimate& estimate, std::vector<FittedParameter>& results);

}  // namespace tissuewarp::registration::detail
