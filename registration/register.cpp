// During the operation, in the order of docs/method.md, section 5:
//   place rigidly → rounds of { linearise the terms → equilibrium → follow } → search on → loads that explain what was
//   seen → contact in balance → judge.
// From the result of an earlier update: rounds → loads as the last search would have found them → contact → judge.

#include "registration/register.hpp"

#include "core/stopwatch.hpp"
#include "registration/doubts.hpp"
#include "registration/go_on.hpp"
#include "registration/pace.hpp"
#include "registration/pose/rigid_part.hpp"
#include "registration/round.hpp"
#include "registration/schedule.hpp"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

struct Registration {
    const PreparedModel& prepared;
    Terms& terms;
    LoadFinder& loads;
    const UpdateOptions& options;
    Observer& observer;
    const Schedule schedule;
    RoundSolver rounds;
    Pace pace;
    Standing at;
    FoundLoads found = {};  // those that act

    UpdateResult run() {
        place_rigidly();
        go_through_rounds();
        search_on();
        explain_by_loads();
        settle_contact();
        judge();
        return std::move(at.result);
    }

    UpdateResult run_on(const UpdateResult& last, const Eigen::Isometry3d& placement) {
        stand_where_ended(last, placement);
        go_through_rounds();
        let_loads_follow();
        settle_contact();
        judge();
        return std::move(at.result);
    }

    void stand_where_ended(const UpdateResult& last, const Eigen::Isometry3d& placement) {
        at.state.placement = placement;
        at.state.displacement = last.deformation.displacement;
        at.result.alignment = last.alignment;
        let_act(last.carried_on->loads);
    }

    void place_rigidly() {
        Stopwatch stopwatch;
        if (options.align) at.result.alignment = terms.pose(observer);
        at.state.placement = at.result.alignment.placement;
        add_time(at.result.times, stages::alignment, stopwatch.lap());
    }

    void go_through_rounds() {
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

    /// Tissue that blocks misplaced comes nearer by a voxel and a half with each dense search: searches go on while
    /// they bring the images into better agreement, each with two rounds that weigh what it found.
    void search_on() {
        for (int more = 1; terms.gains() && more <= course_options.more_searches; ++more) {
            if (at.result.cut_short || !pace.room_for(course_options.rounds_of_search)) return;
            for (int round = 0; round < course_options.rounds_of_search; ++round)
                solve(schedule.last_with_more_searches(more));
            pace.lap();
        }
    }

    /// What data show was done by loads that nobody stated; these also move what they do not show. A second time, since
    /// the first brings more points within reach. Where tissue does not bear them, all stays as it was without.
    void explain_by_loads() {
        for (int time = 0; time < course_options.load_searches && terms.unknown_loads(); ++time) {
            if (at.result.cut_short || !loads.worth_while(*terms.unknown_loads(), pace.share_left())) return;
            const Standing before = at;
            const FoundLoads acted = found;
            try {
                find_loads();
                settle_loads();
            } catch (const SolverFailure& failure) {
                observer.note(std::string("unknown loads are left out: ") + failure.what());
                at = before;
                found = acted;
                return;
            }
        }
    }

    void find_loads() {
        Stopwatch stopwatch;
        let_act(loads.find(*terms.unknown_loads(), at.result.pulls, observer));
        add_time(at.result.times, stages::unknown_loads, stopwatch.lap());
    }

    /// Loads that acted already change with what data show; where they change ever more, data pull by too different
    /// springs, and loads are sought by those.
    void let_loads_follow() {
        double before_mm = std::numeric_limits<double>::infinity();
        for (int done = 0; found.search && !at.result.cut_short && done < go_on_course.load_rounds; ++done) {
            FoundLoads next = found_beside(found, at.state.displacement);
            const double change_mm = difference_mm(next, found);
            const bool settled = change_mm < go_on_course.settled_loads_mm;
            if (!settled && change_mm > go_on_course.most_growth * before_mm) {
                find_loads();
                return settle_loads();
            }
            let_act(std::move(next));
            solve(schedule.last());
            if (settled) return;
            before_mm = change_mm;
        }
    }

    void let_act(FoundLoads loads_found) {
        found = std::move(loads_found);
        at.state.found_loads = found.forces();
        at.state.load_size = found.size;
    }

    void settle_loads() {
        solve(schedule.last_but_one());
        for (int done = 1; done < course_options.load_rounds; ++done)
            if (solve(schedule.last()).largest_change_mm < options.settled_mm) return;
    }

    /// Rounds that change the contact alone, until it is in balance.
    void settle_contact() {
        for (int done = 0; !terms.settled(at.state) && done < course_options.contact_rounds; ++done)
            at.result.rounds.push_back(rounds.solve(schedule.last(), at));
    }

    Round solve(const RoundPlan& plan) {
        const Round record = rounds.solve(plan, at);
        at.result.rounds.push_back(record);
        give_rigid_part_to_placement(prepared.model.mesh.nodes, at.result.pulls.placed_by(), at.state);
        return record;
    }

    /// What the data say of the result.
    void judge() {
        UpdateResult& result = at.result;
        result.alignment.placement = at.state.placement;
        result.deformation = {prepared.model.mesh, at.state.displacement, at.state.placement};
        result.doubts = doubts_of_course(result);
        terms.judge(at.state, result);
        result.carried_on = std::make_shared<const CarriedOn>(CarriedOn{{}, {}, 0, found});
    }
};

Registration registration_of(const PreparedModel& prepared, Terms& terms, LoadFinder& loads, tled::Engine& engine,
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

}  // namespace

UpdateResult register_model(const PreparedModel& prepared, Terms& terms, LoadFinder& loads, tled::Engine& engine,
                            const UpdateOptions& options, Observer& observer) {
    return registration_of(prepared, terms, loads, engine, options, observer).run();
}

UpdateResult register_on(const UpdateResult& last, const Eigen::Isometry3d& placement, const PreparedModel& prepared,
                         Terms& terms, LoadFinder& loads, tled::Engine& engine, const UpdateOptions& options,
                         Observer& observer) {
    return registration_of(prepared, terms, loads, engine, options, observer).run_on(last, placement);
}

}  // namespace tissuewarp::registration::detail
