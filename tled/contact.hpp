#pragma once
/// Static equilibrium of tissue that rests against rigid bodies, and of surfaces that may part.

#include "tled/equilibrium.hpp"

namespace tissuewarp::tled {

struct ContactOptions {
    EquilibriumOptions equilibrium{};
    double penetration_mm = 0.01;  ///< accepted distance of a touching node from the surface, on either side of it
    int most_rounds = 60;
    double stiffness = 1.0;  ///< of a touching node's spring, in parts of the node's diagonal stiffness at rest
};

struct ContactResult {
    EquilibriumResult equilibrium;  ///< of the last round; evaluations and triangular solves of all
    int rounds = 0;
    int touching = 0;                     ///< nodes
    double largest_penetration_mm = 0.0;  ///< of any node that may touch
    int pressing = 0;                     ///< pairs that may part and do not
    Eigen::Matrix3Xd reaction;            ///< of the obstacles on the nodes, mN, 3 × N
};

/// Equilibrium under `conditions` and the unilateral, frictionless contact that they hold, with bodies and of pairs
/// that may part; the engine is left without it. Each round solves the equilibrium with a spring along the surface's
/// normal at every touching node, pushes the spring's end on by what the node still lies inside (the augmented
/// Lagrangian of Simo and Laursen 1992: the springs end up carrying the contact force at no penetration, whatever their
/// stiffness), lets go of nodes that are pulled and takes those that have entered. Pairs that may part are held
/// together or absent in a round: those that are pulled are let go for the next, those that overlap are held.
///
/// Tissue that rolls on to other nodes or flattens within a round finds none so. Then damped motion leads to where it
/// lies, and Newton's method solves rounds of contact that pushes and never pulls (one_sided_contact.hpp).
///
/// Throws InvalidInput without either or with friction, which depends on the way there: take dynamics; SolverFailure
/// when the rounds do not settle, or from an equilibrium.
ContactResult equilibrium_in_contact(Engine& engine, const RestState& rest, const NodalConditions& conditions,
                                     const ContactOptions& options = {}, const Eigen::Matrix3Xd* start = nullptr,
                                     Observer& observer = silent_observer());

}  // namespace tissuewarp::tled
