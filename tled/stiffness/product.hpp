#pragma once
/// A linear operator on nodal vectors.

#include <Eigen/Core>

#include <functional>

namespace tissuewarp::tled::detail {

/// Vectors to a matrix times them, 3 × N.
using Product = std::function<Eigen::Matrix3Xd(const Eigen::Matrix3Xd&)>;

}  // namespace tissuewarp::tled::detail
