#pragma once
/// The unknowns of a registration.

#include <Eigen/Geometry>

namespace tissuewarp::registration::detail {

/// Where the model is, and what moves it that nobody stated.
struct State {
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed
    Eigen::Matrix3Xd displacement;                                ///< 3 × N, mm, moving frame
    Eigen::Matrix3Xd found_loads = {};                            ///< on the nodes, 3 × N, mN; 3 × 0: none
    double load_size = 0;  ///< of these: they strain tissue by about its square times the energy unit
};

}  // namespace tissuewarp::registration::detail
