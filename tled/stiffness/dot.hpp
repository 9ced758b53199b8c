#pragma once
#include <Eigen/Core>

namespace tissuewarp::tled::detail {

/// Of two fields on nodes, 3×N.
inline double dot(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) {
    return a.cwiseProduct(b).sum();
}

}  // namespace tissuewarp::tled::detail
