#pragma once
/// How far off tissue is expected to lie, by a posterior that is already there.

#include "registration/loads/posterior.hpp"
#include "registration/uncertainty.hpp"

namespace tissuewarp::registration::detail {

/// At 16 of the nodes (3 × N, mm), each the farthest from those before.
ExpectedError expected_error(const Eigen::Matrix3Xd& nodes, const Posterior& posterior);

}  // namespace tissuewarp::registration::detail
