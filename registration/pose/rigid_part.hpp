#pragma once
/// Rigid motions that come closest to displacements.

#include "registration/state.hpp"
#include "tled/conditions.hpp"

#include <Eigen/Geometry>

#include <vector>

namespace tissuewarp::registration::detail {

/// argmin Σ w ‖R x + t − y‖² over rotations R and shifts t, x and y 3 × N (Kabsch, Acta Cryst A 32 (1976) 922).
Eigen::Isometry3d closest_motion(const Eigen::Matrix3Xd& x, const Eigen::Matrix3Xd& y, const Eigen::VectorXd& weights);

/// Six fields, 3N × 6, the nodes' vectors one after the other: shifts along and turns about the axes through the mean
/// of the nodes (3 × N), each of mean square 1 or less.
Eigen::MatrixXd rigid_motions(const Eigen::Matrix3Xd& nodes);

/// Moves the placement by the rigid motion that comes closest to the displacement of the nodes (3 × N) that springs
/// hold, each weighed by its stiffness, and leaves the rest to the displacement; no tissue moves. Nothing without
/// springs.
void give_rigid_part_to_placement(const Eigen::Matrix3Xd& nodes, const std::vector<tled::Spring>& weights,
                                  State& state);

}  // namespace tissuewarp::registration::detail
