// An update from where an earlier one ended: rounds → loads as the last search for them would have found them → contact
// in balance → judge.

#include "registration/course/course.hpp"
#include "registration/course/go_on.hpp"
#include "registration/register.hpp"

#include <utility>

namespace tissuewarp::registration::detail {

namespace {

void stand_where_ended(Course& course, const UpdateResult& last, const Eigen::Isometry3d& placement) {
    course.at.state.placement = placement;
    course.at.state.displacement = last.deformation.displacement;
    course.at.result.alignment = last.alignment;
    if (course.terms.unknown_loads()) course.let_act(last.carried_on->loads);
}

void seek_loads(Course& course) {
    course.find_loads();
    course.settle_loads();
}

/// Loads that acted already change with what data show; where they change by far or ever more, data pull by too
/// different springs, and loads are sought by those.
void let_loads_follow(Course& course) {
    if (!course.found.search || course.at.result.cut_short) return;
    if (!course.found.search->may_be_followed) return seek_loads(course);
    double most_mm = go_on_course.most_load_change_mm;
    for (int done = 0; !course.at.result.cut_short && done < go_on_course.load_rounds; ++done) {
        FoundLoads next = found_beside(course.found, course.at.state.displacement, go_on_course.load_step);
        const double change_mm = difference_mm(next, course.found);
        const bool settled = change_mm < go_on_course.settled_loads_mm;
        if (!settled && change_mm > most_mm) return seek_loads(course);
        course.let_act(std::move(next));
        course.solve(course.schedule.last());
        if (settled) return;
        most_mm = go_on_course.most_growth * change_mm;
    }
}

}  // namespace

UpdateResult register_on(const UpdateResult& last, const Eigen::Isometry3d& placement, const PreparedModel& prepared,
                         Terms& terms, LoadFinder& loads, tled::Engine& engine, const UpdateOptions& options,
                         Observer& observer) {
    Course course = course_of(prepared, terms, loads, engine, options, observer);
    stand_where_ended(course, last, placement);
    course.go_through_rounds();
    let_loads_follow(course);
    course.settle_contact();
    return course.judged();
}

}  // namespace tissuewarp::registration::detail
