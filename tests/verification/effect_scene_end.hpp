#pragma once
/// The end of a scene.

#include "simulation/run.hpp"
#include "tests/verification/effect_cases.hpp"

namespace tissuewarp::verification::effects {

/// Displacement (3 × N, mm) of the last frame.
inline Eigen::Matrix3Xd end_of(const simulation::BuiltScene& built, const MakeEngine& make) {
    Eigen::Matrix3Xd displacement;
    simulation::simulate(built, make, [&](const simulation::Frame& frame) { displacement = frame.displacement; });
    return displacement;
}

}  // namespace tissuewarp::verification::effects
