#pragma once
/// One round of a registration: linearise the terms → equilibrium → follow.

#include "registration/solver.hpp"
#include "registration/springs/slid_surfaces.hpp"
#include "registration/terms/terms.hpp"

namespace tissuewarp::registration::detail {

/// Where a registration stands. Copied and put back as a whole where an attempt fails.
struct Standing {
    State state;
    UpdateResult result;
};

/// Before the first round.
Standing at_rest(const PreparedModel& prepared, const tled::Engine& engine);

class RoundSolver {
public:
    /// Model, terms, engine and observer outlive this.
    RoundSolver(const PreparedModel& prepared, Terms& terms, tled::Engine& engine, const UpdateOptions& options,
                Observer& observer);

    /// A round as planned. Where following the equilibrium changed what the terms ask for, as nodes do that touch a
    /// rigid neighbour from then on, it is solved again, four times at most. Throws SolverFailure, InvalidInput,
    /// Cancelled; then the state is as it was.
    Round solve(const RoundPlan& plan, Standing& standing);

private:
    const PreparedModel& prepared_;
    Terms& terms_;
    Observer& observer_;
    SlidSurfaces slid_;
    Solver solver_;

    [[nodiscard]] tled::NodalConditions linearised(const RoundPlan& plan, Standing& standing, Round& record);
};

}  // namespace tissuewarp::registration::detail
