#pragma once
/// The step along a direction, where engines give forces and no energy.

#include "tled/statics/equilibrium_search.hpp"

#include <optional>

namespace tissuewarp::tled::detail {

struct LineStep {
    double length = 0;
    Eigen::Matrix3Xd residual;  ///< at its end, mN
};

/// From `displacement` with its `residual` along `direction` (3 × N, mm): where the slope r·d has fallen enough and
/// every det F is positive, by secants between the ends. Nothing where the direction leads uphill or no such step is
/// found.
std::optional<LineStep> line_search(EquilibriumSearch& search, const Eigen::Matrix3Xd& displacement,
                                    const Eigen::Matrix3Xd& residual, const Eigen::Matrix3Xd& direction);

}  // namespace tissuewarp::tled::detail
