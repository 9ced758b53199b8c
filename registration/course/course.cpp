#include "registration/course/course.hpp"

#include "core/stopwatch.hpp"
#include "registration/course/go_on.hpp"
#include "registration/doubts.hpp"
#include "registration/pose/rigid_part.hpp"

#include <memory>
#include <utility>

namespace tissuewarp::registration::detail {

Course course_of(const PreparedModel& prepared, Terms& terms, LoadFinder& loads, tled::Engine& engine,
                 const UpdateOptions& options, Observer& observer) {
    return {prepared,
            terms,
            loads,
            options,
            observer,
            Schedule(options, terms.searches()),
            RoundSolver(prepared, terms, engine, options, observer),
            Pace(options.time_budget_s),
            at_rest(prepared, engine)};
}

void Course::go_through_rounds() {
    pace.begin_rounds();
    const int last = schedule.count() - 1;
    int round = 0;
    for (int done = 0; done < course_options.rounds_over_planned * schedule.count() && round < schedule.count();
         ++done) {
        const Round record = solve(schedule.round(round));
        observer.checkpoint("registration", double(round + 1) / schedule.count());
        pace.lap();
        const bool hurry = round < last && !pace.room_for(2);
        at.result.cut_short = hurry && !pace.room_for(1);
        if (at.result.cut_short) return;
        round = hurry ? last : schedule.after(round, record);
    }
}

Round Course::solve(const RoundPlan& plan) {
    const Round record = rounds.solve(plan, at);
    at.result.rounds.push_back(record);
    give_rigid_part_to_placement(prepared.model.mesh.nodes, at.result.pulls.placed_by(), at.state);
    return record;
}

void Course::find_loads() {
    Stopwatch stopwatch;
    let_act(loads.find(*terms.unknown_loads(), at.result.pulls, observer));
    add_time(at.result.times, stages::unknown_loads, stopwatch.lap());
}

bool Course::follow_loads() {
    Stopwatch stopwatch;
    constexpr double whole = 1;
    FoundLoads next = found_beside(found, at.state.displacement, whole);
    const bool near = difference_mm(next, found) < course_options.most_followed_mm;
    if (near) let_act(std::move(next));
    add_time(at.result.times, stages::unknown_loads, stopwatch.lap());
    return near;
}

void Course::let_act(FoundLoads loads_found) {
    found = std::move(loads_found);
    at.state.found_loads = found.forces();
    at.state.load_size = found.size;
}

void Course::settle_loads() {
    solve(schedule.last_but_one());
    for (int done = 1; done < course_options.load_rounds; ++done)
        if (solve(schedule.last()).largest_change_mm < options.settled_mm) return;
}

void Course::settle_contact() {
    for (int done = 0; !terms.settled(at.state) && done < course_options.contact_rounds; ++done)
        at.result.rounds.push_back(rounds.solve(schedule.last(), at));
}

UpdateResult Course::judged() {
    Stopwatch stopwatch;
    UpdateResult& result = at.result;
    result.alignment.placement = at.state.placement;
    result.deformation = {prepared.model.mesh, at.state.displacement, at.state.placement};
    result.doubts = doubts_of_course(result);
    terms.judge(at.state, result);
    add_time(result.times, stages::judgement, stopwatch.lap());
    result.carried_on = std::make_shared<const CarriedOn>(CarriedOn{{}, {}, 0, found});
    return std::move(at.result);
}

}  // namespace tissuewarp::registration::detail
