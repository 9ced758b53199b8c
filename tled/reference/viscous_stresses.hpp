#pragma once
/// Viscous stresses in plain float64, over any interval: what the clocked stresses of the engines are tested against.

#include "tled/model/internal_force.hpp"

namespace tissuewarp::tled {

/// No stress in any term.
ViscousStresses unstressed(const RestState& rest);

/// The viscous stresses after an interval (s) at a displacement (viscosity.hpp).
ViscousStresses advanced(const RestState& rest, ViscousStresses stresses, const Eigen::Matrix3Xd& displacement,
                         double interval);

}  // namespace tissuewarp::tled
