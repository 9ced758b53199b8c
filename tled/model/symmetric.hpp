#pragma once
/// The one order of a symmetric matrix's six numbers, here and in shaders: xx yy zz xy yz zx.

#include <Eigen/Core>

namespace tissuewarp::tled {

using SymmetricEntries = Eigen::Matrix<double, 6, 1>;

inline Eigen::Matrix3d symmetric_matrix(const SymmetricEntries& k) {
    return Eigen::Matrix3d{{k[0], k[3], k[5]}, {k[3], k[1], k[4]}, {k[5], k[4], k[2]}};
}

inline SymmetricEntries symmetric_entries(const Eigen::Matrix3d& matrix) {
    return {matrix(0, 0), matrix(1, 1), matrix(2, 2), matrix(0, 1), matrix(1, 2), matrix(2, 0)};
}

}  // namespace tissuewarp::tled
