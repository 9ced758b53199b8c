// During the operation, in the order of docs/method.md, section 5:
//   place rigidly → rounds of { linearise the terms → equilibrium → follow } → search on → loads that explain what was
//   seen → contact in balance → judge.

#include "registration/register.hpp"

#include "core/stopwatch.hpp"
#include "registration/course/course.hpp"

#include <string>

namespace tissuewarp::registration::detail {

namespace {

void place_rigidly(Course& course) {
    Stopwatch stopwatch;
    if (course.options.align) course.at.result.alignment = course.terms.pose(course.observer);
    course.at.state.placement = course.at.result.alignment.placement;
    add_time(course.at.result.times, stages::alignment, stopwatch.lap());
}

/// Tissue that blocks misplaced comes nearer by a voxel and a half with each dense search: searches go on while
/// they bring the images into better agreement, each with two rounds that weigh what it found.
void search_on(Course& course) {
    for (int more = 1; course.terms.gains() && more <= course_options.more_searches; ++more) {
        if (course.at.result.cut_short || !course.pace.room_for(course_options.rounds_of_search)) return;
        for (int round = 0; round < course_options.rounds_of_search; ++round)
            course.solve(course.schedule.last_with_more_searches(more));
        course.pace.lap();
    }
}

/// What data show was done by loads that nobody stated; these also move what they do not show. A second time, since
/// the first brings more points within reach; the three numbers of weight then follow by the springs of the first time,
/// where these lead to about the same. Where tissue does not bear loads, all stays as it was without.
void explain_by_loads(Course& course) {
    for (int time = 0; time < course_options.load_searches && course.terms.unknown_loads(); ++time) {
        if (course.at.result.cut_short ||
            !course.loads.worth_while(*course.terms.unknown_loads(), course.pace.share_left()))
            return;
        const Standing before = course.at;
        const FoundLoads acted = course.found;
        try {
            const bool may_follow = time > 0 && course.terms.unknown_loads() == LoadKind::Weight;
            if (!may_follow || !course.follow_loads()) course.find_loads();
            course.settle_loads();
        } catch (const SolverFailure& failure) {
            course.observer.note(std::string("unknown loads are left out: ") + failure.what());
            course.at = before;
            course.found = acted;
            return;
        }
    }
}

}  // namespace

UpdateResult register_model(const PreparedModel& prepared, Terms& terms, LoadFinder& loads, tled::Engine& engine,
                            const UpdateOptions& options, Observer& observer) {
    Course course = course_of(prepared, terms, loads, engine, options, observer);
    place_rigidly(course);
    course.go_through_rounds();
    search_on(course);
    explain_by_loads(course);
    course.settle_contact();
    return course.judged();
}

}  // namespace tissuewarp::registration::detail
