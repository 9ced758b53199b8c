#pragma once
/// How far off tissue is expected to lie.

#include "registration/detail/posterior.hpp"

namespace tissuewarp::registration::detail {

/// Of the posterior, at 16 nodes, each the farthest from those before.
ExpectedError expected_error(const PreparedModel& prepared, const WeighedSprings& springs);

}  // namespace tissuewarp::registration::detail
