#pragma once
/// How far off tissue is expected to lie, by a posterior that is already there.

#include "registration/loads/posterior.hpp"
#include "registration/uncertainty.hpp"

namespace tissuewarp::registration::detail {

struct ExpectedErrorOptions {
    int places = 16;  ///< of the organ, that the mean is over: as many solves. Chosen by hand; data not recorded
};
inline constexpr ExpectedErrorOptions expected_error_options{};

/// At 16 of the nodes (3 × N, mm), each the farthest from those before.
ExpectedError expected_error(const Eigen::Matrix3Xd& nodes, const Posterior& posterior);

}  // namespace tissuewarp::registration::detail
