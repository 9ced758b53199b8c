#pragma once
/// The steps of a registration, and where it stands between them (register.cpp, register_on.cpp).

#include "registration/loads/load_finder.hpp"
#include "registration/pace.hpp"
#include "registration/round.hpp"
#include "registration/schedule.hpp"

namespace tissuewarp::registration::detail {

struct Course {
    const PreparedModel& prepared;
    Terms& terms;
    LoadFinder& loads;
    const UpdateOptions& options;
    Observer& observer;
    const Schedule schedule;
    RoundSolver rounds;
    Pace pace;
    Standing at;
    FoundLoads found = {};  ///< loads that nobody stated and that act

    /// All that are planned; some again, none where time runs out.
    void go_through_rounds();
    Round solve(const RoundPlan& plan);
    /// By what pulled in the last round.
    void find_loads();
    /// From those that act, by what pulls now and the springs that pulled when they were found; false, and nothing
    /// done, where that leads far from them.
    bool follow_loads();
    void let_act(FoundLoads loads_found);
    /// Rounds under loads that were found.
    void settle_loads();
    /// Rounds that change the contact alone, until it is in balance.
    void settle_contact();
    /// The result, with what the data say of it. Ends the course.
    UpdateResult judged();
};

/// At rest. Everything given outlives it.
Course course_of(const PreparedModel& prepared, Terms& terms, LoadFinder& loads, tled::Engine& engine,
                 const UpdateOptions& options, Observer& observer);

}  // namespace tissuewarp::registration::detail
