#pragma once
/// A static Newton solver on the discrete energy: slow, simple, and what every method of equilibrium is tested against.

#include "core/observer.hpp"
#include "tled/conditions.hpp"
#include "tled/reference/discrete_energy.hpp"
#include "tled/rest_state.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled {

struct NewtonOptions {
    double tolerance_mm = 1e-9;  ///< largest nodal correction at which the iteration ends
    int max_iterations = 60;
    int load_steps = 1;  ///< imposed displacements, targets and forces applied in equal parts
    /// Where to begin (3 × N, mm), near an equilibrium under the forces and targets, which then act in full; empty: at
    /// rest. For loads along a path, and for conditions that change from one solution to the next.
    Eigen::Matrix3Xd start{};
};

struct NewtonResult {
    Eigen::Matrix3Xd displacement;  ///< 3 × N, mm
    int iterations = 0;
    double last_correction_mm = 0;
};

/// Static equilibrium by Newton's method with a CHOLMOD factor per iteration and a line search that keeps J > 0 and the
/// energy falling; adds a multiple of the diagonal where the tangent is indefinite. Throws SolverFailure, and
/// InvalidInput where a piece of tissue is not held.
NewtonResult newton_equilibrium(const RestState& rest, const NodalConditions& conditions,
                                const NewtonOptions& options = {}, Observer& observer = silent_observer());

/// The same for any discretisation. Precondition: the conditions hold it against rigid motion.
NewtonResult newton_equilibrium(const DiscreteEnergy& energy, const NodalConditions& conditions,
                                const NewtonOptions& options = {}, Observer& observer = silent_observer());

}  // namespace tissuewarp::tled
