#pragma once
/// Where tissue comes to rest that buckles, snaps through, rolls or topples: no path of equilibria leads there.

#include "core/observer.hpp"
#include "tled/engine.hpp"

#include <functional>

namespace tissuewarp::tled {

/// The displacement (3 × N, mm) at which tissue that moves from `start` under `at(1)` has nearly come to rest: explicit
/// dynamics with the tissue's own mass, damped in proportion to it, while the loads go from `at(0)`, under which
/// `start` is at rest, to `at(1)`. It lies on the side to which the tissue falls, and is no equilibrium to any
/// tolerance yet. After four seconds of the tissue's time it is as it is. Throws SolverFailure as dynamics() does.
Eigen::Matrix3Xd displacement_after_motion(Engine& engine, const RestState& rest,
                                           const std::function<NodalConditions(double part)>& at,
                                           const Eigen::Matrix3Xd& start, Observer& observer);

}  // namespace tissuewarp::tled
