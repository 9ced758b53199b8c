#pragma once
/// Springs of NodalConditions as matrices and forces.

#include "tled/conditions.hpp"
#include "tled/model/symmetric.hpp"
#include "tled/parallel/parallel.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled::detail {

/// K of entry `spring`, mN/mm.
inline Eigen::Matrix3d spring_matrix(const NodalConditions& conditions, int spring) {
    return symmetric_matrix(conditions.spring_stiffness.col(spring));
}

/// y += K u at every spring, mN.
inline void add_spring_resistance(const NodalConditions& conditions, const Eigen::Matrix3Xd& u, Eigen::Matrix3Xd& y) {
    parallel_ranges(0, conditions.spring_node.size(), 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t s = begin; s < end; ++s) {
            const int node = conditions.spring_node[s];
            y.col(node) += spring_matrix(conditions, static_cast<int>(s)) * u.col(node);
        }
    });
}

/// External forces plus K·target of the springs, mN, 3 × N.
inline Eigen::Matrix3Xd applied_force(const NodalConditions& conditions) {
    Eigen::Matrix3Xd force = Eigen::Matrix3Xd::Zero(3, conditions.constrained.cols());
    if (conditions.external_force.size() > 0) force += conditions.external_force;
    for (int s = 0; s < static_cast<int>(conditions.spring_node.size()); ++s) {
        force.col(conditions.spring_node[static_cast<std::size_t>(s)]) += conditions.spring_force.col(s);
    }
    return force;
}

}  // namespace tissuewarp::tled::detail
