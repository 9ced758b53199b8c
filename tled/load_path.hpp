#pragma once
/// Equilibrium under loads that are too large to come at once.

#include "tled/equilibrium.hpp"

#include <functional>
#include <optional>

namespace tissuewarp::tled {

/// The equilibrium under the whole load on a coarser mesh, carried on to this one.
struct CoarseStart {
    Eigen::Matrix3Xd displacement;  ///< 3 × N, mm
    EquilibriumMethod method;       ///< that found it: if not Newton's, it came at once, and here it may too
};

struct LoadPathOptions {
    EquilibriumOptions equilibrium{};
    int first_parts = 1;          ///< equal parts to try first
    double smallest_part = 1e-3;  ///< of the load, below which the path is given up
    /// Asked once, where Newton's method may decide, before a path from rest begins; nothing: it goes without.
    std::function<std::optional<CoarseStart>()> coarse_start{};
};

/// Equilibrium under the conditions by way of smaller loads: imposed displacements go from those of `start` (3 × N mm;
/// none: rest) to the prescribed ones, spring targets, forces, pressures and the weight of fluid grow from zero (from
/// rest) or stand from the beginning (from a start). A part that fails is halved, one that succeeds is followed by a
/// larger one, and each begins on the line through the last two equilibria. The evaluations of all parts are summed up
/// in the result. Throws SolverFailure naming the part of the load that was reached.
EquilibriumResult equilibrium_along_load(Engine& engine, const RestStiffness& stiffness,
                                         const NodalConditions& conditions, const LoadPathOptions& options = {},
                                         const Eigen::Matrix3Xd* start = nullptr,
                                         Observer& observer = silent_observer());

/// The same for tissue that buckles, snaps through or topples on the way, beyond which there are no equilibria near:
/// damped motion (tled/damped_motion.hpp) leads on from the last one, Newton's method ends it, and the observer is
/// told. Without viscosity, and with the automatic choice of the method only. What is found is judged by the tangent.
EquilibriumResult equilibrium_along_load_or_motion(Engine& engine, const RestStiffness& stiffness,
                                                   const NodalConditions& conditions,
                                                   const LoadPathOptions& options = {},
                                                   const Eigen::Matrix3Xd* start = nullptr,
                                                   Observer& observer = silent_observer());

}  // namespace tissuewarp::tled
