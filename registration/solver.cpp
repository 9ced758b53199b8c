#include "registration/solver.hpp"

#include "registration/doubts.hpp"

#include <string>

namespace tissuewarp::registration::detail {

Solver::Solver(const PreparedModel& prepared, tled::Engine& engine, const UpdateOptions& options, bool own_metric)
    : prepared_(prepared),
      engine_(engine),
      asked_for_(options.equilibrium.method),
      equilibrium_(options.equilibrium),
      step_mm_(options.most_step_mm),
      own_metric_(own_metric) {
    equilibrium_.known_highest = prepared.stiffness.approximate_highest_eigenvalue();
}

tled::EquilibriumResult Solver::solve(const StepBoundConditions& conditions, const Eigen::Matrix3Xd& start,
                                      Observer& observer) {
    for (int halving = 0;; ++halving) {
        const tled::NodalConditions here = conditions(step_mm_);
        try {
            return try_to_solve(here, start, observer);
        } catch (const SolverFailure& failure) {
            if (halving == retry_options.halvings) throw;
            relaxation_failed_ |= equilibrium_.method == tled::EquilibriumMethod::SelfCheckedRelaxation;
            equilibrium_.method = asked_for_;
            step_mm_ /= 2;
            observer.note("a round is repeated with steps of at most " + to_text(step_mm_) + " mm: " + failure.what());
        }
    }
}

tled::EquilibriumResult Solver::try_to_solve(const tled::NodalConditions& conditions, const Eigen::Matrix3Xd& start,
                                             Observer& observer) {
    if (own_metric_ && !metric_is_current_) renew_metric(conditions);
    choose_method();
    tled::EquilibriumResult solved = tled::equilibrium(engine_, metric_ ? *metric_ : prepared_.stiffness, conditions,
                                                       equilibrium_, &start, observer);
    equilibrium_.method = solved.method;  // chosen and explained once, not in every round
    if (solved.highest > 0) equilibrium_.known_highest = solved.highest;
    return solved;
}

/// The slowest mode is sought from that of the springs before, at first of those that the model was prepared with.
void Solver::renew_metric(const tled::NodalConditions& conditions) {
    const tled::RestStiffness& before = metric_ ? *metric_ : prepared_.stiffness;
    metric_ = tled::RestStiffness(prepared_.rest, conditions, prepared_.stiffness, before.approximate_slowest_mode());
    metric_is_current_ = true;
}

/// Relaxation needs no factor; where it failed, L-BFGS with a factor of the data's own springs takes a handful of
/// solves.
void Solver::choose_method() {
    if (equilibrium_.method != tled::EquilibriumMethod::Automatic) return;
    if (!relaxation_failed_)
        equilibrium_.method = tled::EquilibriumMethod::SelfCheckedRelaxation;
    else if (metric_ && engine_.processor() == tled::Processor::Cpu)
        equilibrium_.method = tled::EquilibriumMethod::Lbfgs;
}

}  // namespace tissuewarp::registration::detail
