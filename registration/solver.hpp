#pragma once
/// Equilibria of one registration: which method, in which metric, and what to do where one fails. Knows no datum.

#include "registration/options.hpp"
#include "registration/prepare.hpp"
#include "tled/engine.hpp"
#include "tled/equilibrium.hpp"

#include <functional>
#include <optional>

namespace tissuewarp::registration::detail {

struct RetryOptions {
    int halvings = 4;  ///< of the step where an equilibrium fails, at most. Chosen by hand; data not recorded
};
inline constexpr RetryOptions retry_options{};

/// What pulls at the tissue where nothing is asked to move farther than so many mm.
using StepBoundConditions = std::function<tled::NodalConditions(double most_step_mm)>;

class Solver {
public:
    /// Data other than labels pull with other springs than those that the model was prepared with: with `own_metric`
    /// what relaxes slowest, and what a factor would be of, follow from them. Model and engine outlive this.
    Solver(const PreparedModel& prepared, tled::Engine& engine, const UpdateOptions& options, bool own_metric);

    /// The equilibrium from `start` (3 × N mm); where there is none, that of half the step, four times at most, with a
    /// note. Smaller steps stay for what follows. Throws SolverFailure, Cancelled; then nothing but the step has
    /// changed.
    [[nodiscard]] tled::EquilibriumResult solve(const StepBoundConditions& conditions, const Eigen::Matrix3Xd& start,
                                                Observer& observer);

    /// The next equilibrium is under other springs: the slowest mode is sought again.
    void springs_changed() { metric_is_current_ = false; }

private:
    const PreparedModel& prepared_;
    tled::Engine& engine_;
    const tled::EquilibriumMethod asked_for_;
    tled::EquilibriumOptions equilibrium_;
    double step_mm_;
    bool own_metric_;
    std::optional<tled::RestStiffness> metric_;
    bool metric_is_current_ = false;
    bool relaxation_failed_ = false;

    [[nodiscard]] tled::EquilibriumResult try_to_solve(const tled::NodalConditions& conditions,
                                                       const Eigen::Matrix3Xd& start, Observer& observer);
    void renew_metric(const tled::NodalConditions& conditions);
    void choose_method();
};

}  // namespace tissuewarp::registration::detail
