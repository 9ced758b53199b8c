#pragma once
/// The discrete energy and its exact gradient in plain float64 scalar code: slow, simple, and what every engine is
/// tested against.

#include "tled/rest_state.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::tled {

/// Elastic energy of a displacement (3 × N mm), mN·mm.
double elastic_energy(const RestState& rest, const Eigen::Matrix3Xd& displacement);

/// f_int = ∂E/∂u, mN, 3 × N.
Eigen::Matrix3Xd internal_force(const RestState& rest, const Eigen::Matrix3Xd& displacement);

/// Viscous stresses q_i (second Piola–Kirchhoff, kPa) of every element, in the internal order; elements of elastic
/// materials have none.
using ViscousStresses = std::vector<std::vector<Eigen::Matrix3d>>;

/// f_int with the viscous stresses taken off: P = ∂W/∂F − F Σ q_i, mN, 3 × N.
Eigen::Matrix3Xd internal_force(const RestState& rest, const Eigen::Matrix3Xd& displacement,
                                const ViscousStresses& stresses);

/// det F of every element, in the order of the mesh.
Eigen::VectorXd jacobians(const RestState& rest, const Eigen::Matrix3Xd& displacement);

}  // namespace tissuewarp::tled
