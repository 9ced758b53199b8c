#include "registration/round.hpp"

#include "core/stopwatch.hpp"
#include "registration/springs/conditions.hpp"

#include <cmath>
#include <utility>

namespace tissuewarp::registration::detail {

Standing at_rest(const PreparedModel& prepared, const tled::Engine& engine) {
    Standing start;
    start.state.displacement.setZero(3, prepared.rest.node_count);
    start.result.engine = engine.description();
    return start;
}

RoundSolver::RoundSolver(const PreparedModel& prepared, Terms& terms, tled::Engine& engine,
                         const UpdateOptions& options, Observer& observer)
    : prepared_(prepared),
      terms_(terms),
      observer_(observer),
      slid_(prepared),
      solver_(prepared, engine, options, terms.take_own_metric()) {}

Round RoundSolver::solve(const RoundPlan& plan, Standing& standing) {
    State& state = standing.state;
    Stopwatch stopwatch;
    Round record;
    record.range_mm = plan.range_mm;
    const auto conditions = [&](double most_step_mm) {
        RoundPlan bounded = plan;
        bounded.most_step_mm = most_step_mm;
        tled::NodalConditions asked = linearised(bounded, standing, record);
        add_time(standing.result.times, stages::correspondence, stopwatch.lap());
        return asked;
    };
    for (int pass = 1;; ++pass) {
        const tled::EquilibriumResult solved = solver_.solve(conditions, state.displacement, observer_);
        add_time(standing.result.times, stages::equilibrium, stopwatch.lap());
        record.force_evaluations += solved.force_evaluations;
        record.estimated_error_mm = solved.estimated_error_mm;
        if (terms_.follow({state.placement, solved.displacement}) && pass < course_options.passes) {
            solver_.springs_changed();
            continue;
        }
        record.largest_change_mm =
            std::sqrt((solved.displacement - state.displacement).colwise().squaredNorm().maxCoeff());
        state.displacement = solved.displacement;
        standing.result.min_jacobian = solved.min_jacobian;
        return record;
    }
}

tled::NodalConditions RoundSolver::linearised(const RoundPlan& plan, Standing& standing, Round& record) {
    const State& state = standing.state;
    Contribution sum = terms_.linearise(plan, state, observer_);
    if (sum.pulls_anew) solver_.springs_changed();
    record.interface_nodes = sum.candidates;
    record.matched = sum.matched;
    record.held_back = sum.held_back;
    record.mean_residual_mm = sum.mean_residual_mm;
    tled::Conditions all;
    for (const PulledNode& pulled : sum.springs) all.springs.push_back(pulled.spring);
    if (sum.forces.cols() == 0) sum.forces.setZero(3, prepared_.rest.node_count);
    if (const Eigen::Matrix3Xd slid = slid_.forces(state.displacement); slid.cols() > 0) sum.forces += slid;
    all.external_force = sum.forces;
    standing.result.pulls = {std::move(sum.springs),
                             state.placement,
                             std::move(sum.forces),
                             terms_.energy(),
                             terms_.prior_moves(),
                             terms_.parts_alone(),
                             terms_.placement_sought(),
                             terms_.hardly_shown(state.placement, prepared_.model.mesh.nodes),
                             state.load_size};
    return conditions_on(prepared_, std::move(all));
}

}  // namespace tissuewarp::registration::detail
