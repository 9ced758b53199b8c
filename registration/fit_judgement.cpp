#include "registration/detail/fit_judgement.hpp"

#include "registration/uncertainty/doubts.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <map>

namespace tissuewarp::registration::detail {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double most_of_prior = 0.5;  // deviation that a parameter seen by the data keeps
constexpr double most_correlation = 0.95;
constexpr double least_improvement = 1.645;  // of the held-out misfit, in deviations of its scatter over blocks

/// χ² quantiles of 95 % for one and three scalars.
double significance(std::size_t scalars) {
    return scalars == 1 ? 3.84 : 7.81;
}

std::string percent(double share) {
    return std::to_string(std::lround(100 * share)) + " %";
}

/// The verdicts on an estimate.
class Judgement {
public:
    Judgement(const std::vector<FitScalar>& scalars, const std::vector<std::size_t>& active,
              const FitEstimate& estimate, std::vector<FittedParameter>& results)
        : scalars_(scalars), active_(active), estimate_(estimate), results_(results) {}

    /// Takes those that the data do not tell out of the active ones; true when some were. What several reasons speak
    /// against is left for one of them: without it the others are estimated anew.
    std::vector<std::size_t> kept() {
        for (std::size_t k = 0; k < active_.size(); ++k) record(k);
        find_confounded();
        if (rejected_.empty()) find_unseen();
        if (rejected_.empty()) find_bounded();
        if (rejected_.empty()) find_agreeing();
        std::vector<std::size_t> kept;
        for (const std::size_t k : active_)
            if (std::find(rejected_.begin(), rejected_.end(), k) == rejected_.end()) kept.push_back(k);
        return kept;
    }

private:
    const std::vector<FitScalar>& scalars_;
    const std::vector<std::size_t>& active_;
    const FitEstimate& estimate_;
    std::vector<FittedParameter>& results_;
    std::vector<std::size_t> rejected_;

    [[nodiscard]] double x(std::size_t k) const { return estimate_.x[Eigen::Index(active_[k])]; }
    [[nodiscard]] double deviation(std::size_t k) const {
        return std::sqrt(estimate_.covariance(Eigen::Index(k), Eigen::Index(k)));
    }
    void record(std::size_t k) {
        const FitScalar& scalar = scalars_[active_[k]];
        FittedParameter& result = results_[active_[k]];
        result.fitted = scalar.value(x(k));
        result.deviation = deviation(k) * scalar.slope(x(k));
        result.outcome = FitOutcome::Fitted;
        result.reason = "the data tell it";
    }
    void reject(std::size_t k, FitOutcome outcome, const std::string& reason) {
        results_[active_[k]].outcome = outcome;
        results_[active_[k]].reason = reason;
        rejected_.push_back(active_[k]);
    }
    void find_confounded() {
        for (std::size_t a = 0; a < active_.size(); ++a)
            for (std::size_t b = 0; b < active_.size(); ++b) {
                if (a == b) continue;
                const double correlation =
                    estimate_.covariance(Eigen::Index(a), Eigen::Index(b)) / (deviation(a) * deviation(b));
                const bool wide = std::max(deviation(a), deviation(b)) > most_of_prior;
                if (!wide || std::abs(correlation) <= most_correlation) continue;
                reject(a, FitOutcome::Confounded,
                       "the data cannot tell it from " + scalars_[active_[b]].name + " (correlation " +
                           to_text(correlation) + ")");
                break;
            }
    }
    void find_unseen() {
        for (std::size_t k = 0; k < active_.size(); ++k)
            if (deviation(k) > most_of_prior)
                reject(k, FitOutcome::NotSeen,
                       "the data leave it " + percent(deviation(k)) + " of what was uncertain before");
    }
    void find_bounded() {
        constexpr double at_end = 0.03;
        for (std::size_t k = 0; k < active_.size(); ++k) {
            const FitScalar& scalar = scalars_[active_[k]];
            if (std::min(x(k) - scalar.least, scalar.most - x(k)) < at_end)
                reject(k, FitOutcome::AtBound,
                       "the data ask for more than is admitted; the model lacks something else");
        }
    }
    /// Scalars of one parameter together: a vector's direction is not bent by dropping what is small of it.
    void find_agreeing() {
        std::map<std::size_t, std::vector<std::size_t>> groups;
        for (std::size_t k = 0; k < active_.size(); ++k) groups[scalars_[active_[k]].parameter].push_back(k);
        for (const auto& [parameter, members] : groups) {
            VectorXd at(Eigen::Index(members.size()));
            for (std::size_t m = 0; m < members.size(); ++m) at[Eigen::Index(m)] = x(members[m]);
            const MatrixXd block = estimate_.covariance(members, members);
            const double distance = at.dot(block.ldlt().solve(at));
            if (distance > significance(members.size()) && estimate_.improvement > least_improvement) continue;
            for (const std::size_t k : members)
                reject(k, FitOutcome::Agrees, "the given value predicts the held-out data as well");
        }
    }
};

}  // namespace

std::vector<std::size_t> told_by_data(const std::vector<FitScalar>& scalars, const std::vector<std::size_t>& active,
                                      const FitEstimate& estimate, std::vector<FittedParameter>& results) {
    return Judgement(scalars, active, estimate, results).kept();
}

}  // namespace tissuewarp::registration::detail
