// Which tissue and loads predict best what data show elsewhere, and how well the data tell.

#include "registration/parameter_fit.hpp"

#include "registration/detail/doubts.hpp"
#include "registration/detail/evidence.hpp"
#include "registration/detail/fit_scalars.hpp"
#include "registration/detail/held_out.hpp"
#include "registration/detail/stopwatch.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <nlopt.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <exception>
#include <map>

namespace tissuewarp::registration {

namespace {

using detail::FitScalar;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int least_blocks = 8;        // fewer say nothing of their own scatter
constexpr double most_of_prior = 0.5;  // deviation that a parameter seen by the data keeps
constexpr double most_correlation = 0.95;
constexpr double least_improvement = 1.645;  // of the held-out misfit, in deviations of its scatter over blocks
constexpr double derivative_step = 0.1;      // prior deviations

/// χ² quantiles of 95 % for one and three scalars.
double significance(std::size_t scalars) {
    return scalars == 1 ? 3.84 : 7.81;
}

/// The search over scalars, of which some are held at their given values.
class Search {
public:
    Search(detail::HeldOut& held_out, const std::vector<FitScalar>& scalars, detail::Tissue given, double scale_mm,
           Observer& observer)
        : held_out_(held_out), scalars_(scalars), given_(std::move(given)), scale_mm_(scale_mm), observer_(observer) {
        given_by_block_ = misfits(residuals(VectorXd::Zero(Eigen::Index(scalars.size()))));
    }

    /// Squared misfit of each block, mm².
    [[nodiscard]] VectorXd squared(const Eigen::Matrix3Xd& residuals) const {
        VectorXd sums = VectorXd::Zero(held_out_.block_count());
        for (std::size_t s = 0; s < held_out_.block_of().size(); ++s)
            sums[held_out_.block_of()[s]] += residuals.col(Eigen::Index(s)).squaredNorm();
        return sums;
    }
    /// ½ s² d²/(s² + d²) of each block, mm²: support and other forces that no model knows act on some of them.
    [[nodiscard]] VectorXd misfits(const Eigen::Matrix3Xd& residuals) const {
        const double s2 = scale_mm_ * scale_mm_;
        return squared(residuals).unaryExpr([s2](double d2) { return 0.5 * s2 * d2 / (s2 + d2); });
    }
    [[nodiscard]] const VectorXd& given_by_block() const { return given_by_block_; }
    [[nodiscard]] double scale_mm() const { return scale_mm_; }
    [[nodiscard]] detail::Tissue tissue(const VectorXd& x) const {
        detail::Tissue tissue = given_;
        for (std::size_t k = 0; k < scalars_.size(); ++k)
            if (x[Eigen::Index(k)] != 0) scalars_[k].apply(x[Eigen::Index(k)], tissue);
        return tissue;
    }
    [[nodiscard]] Eigen::Matrix3Xd residuals(const VectorXd& x) { return held_out_.residuals(tissue(x), observer_); }

    /// The best values of the active scalars, the others at 0.
    VectorXd minimise(const std::vector<std::size_t>& active);

private:
    detail::HeldOut& held_out_;
    const std::vector<FitScalar>& scalars_;
    detail::Tissue given_;
    double scale_mm_;
    Observer& observer_;
    VectorXd given_by_block_;
    std::exception_ptr stopped_;
    int evaluations_ = 0, most_evaluations_ = 0;

    [[nodiscard]] VectorXd spread(const std::vector<std::size_t>& active, const double* values) const {
        VectorXd x = VectorXd::Zero(Eigen::Index(scalars_.size()));
        for (std::size_t k = 0; k < active.size(); ++k) x[Eigen::Index(active[k])] = values[k];
        return x;
    }
    double cost(const VectorXd& x);
};

/// ½ n log J + ½ ‖x‖²: the likelihood of n normal misfits of unknown variance, at its best variance J/n.
double Search::cost(const VectorXd& x) {
    constexpr double of_failure = 1e3;
    observer_.checkpoint("parameter fit", std::min(1.0, double(evaluations_++) / most_evaluations_));
    try {
        const double ratio = std::max(1e-12, misfits(residuals(x)).sum() / given_by_block_.sum());
        return 0.5 * held_out_.block_count() * std::log(ratio) + 0.5 * x.squaredNorm();
    } catch (const SolverFailure&) {
        return of_failure + x.squaredNorm();  // tissue that finds no rest under these loads
    }
}

VectorXd Search::minimise(const std::vector<std::size_t>& active) {
    struct Call {
        Search& search;
        const std::vector<std::size_t>& active;
    } call{*this, active};
    const auto objective = [](unsigned, const double* values, double*, void* data) {
        const Call& self = *static_cast<Call*>(data);
        try {
            return self.search.cost(self.search.spread(self.active, values));
        } catch (...) {
            self.search.stopped_ = std::current_exception();
            throw nlopt::forced_stop();
        }
    };
    nlopt::opt optimiser(nlopt::LN_BOBYQA, unsigned(active.size()));
    optimiser.set_min_objective(objective, &call);
    std::vector<double> least, most, x(active.size(), 0.0);
    for (const std::size_t k : active) {
        least.push_back(scalars_[k].least);
        most.push_back(scalars_[k].most);
    }
    optimiser.set_lower_bounds(least);
    optimiser.set_upper_bounds(most);
    optimiser.set_initial_step(0.5);
    optimiser.set_xtol_abs(0.01);
    evaluations_ = 0;
    most_evaluations_ = 20 + 20 * int(active.size());
    optimiser.set_maxeval(most_evaluations_);
    double value = 0;
    try {
        optimiser.optimize(x, value);
    } catch (const nlopt::roundoff_limited&) {
        // The best point so far is in x: as good as this cost can be resolved.
    } catch (const nlopt::forced_stop&) {
        std::rethrow_exception(stopped_);
    }
    return spread(active, x.data());
}

/// Estimates of the active scalars with their covariance, in prior deviations.
struct Estimate {
    VectorXd x;               // of all scalars
    MatrixXd covariance;      // of the active ones
    double misfit_ratio = 1;  // of the held-out data, over that with the given values
    double improvement = 0;   // of this misfit, in deviations of its scatter over blocks
};

/// ∂ residuals / ∂ x_k by differences that stay within the bounds.
VectorXd derivative(Search& search, const FitScalar& scalar, VectorXd x, Eigen::Index k) {
    const double at = x[k], above = std::min(scalar.most, at + derivative_step),
                 below = std::max(scalar.least, at - derivative_step);
    x[k] = above;
    const Eigen::Matrix3Xd high = search.residuals(x);
    x[k] = below;
    const Eigen::Matrix3Xd difference = (high - search.residuals(x)) / (above - below);
    return Eigen::Map<const VectorXd>(difference.data(), difference.size());
}

/// With the sensitivities S of the residuals r, the weights w of the blocks, φ the misfit per block, H = SᵀwS/φ and
/// G = Σ g gᵀ/φ² over the blocks' own slopes g = Sᵀwr, the estimate scatters by (H + 1)⁻¹ (G + 1) (H + 1)⁻¹ (Liang and
/// Zeger 1986; 1 is the prior): data of one block may err together, and by whatever size.
MatrixXd covariance(const Search& search, const detail::HeldOut& held_out, const MatrixXd& sensitivity,
                    const Eigen::Matrix3Xd& residuals) {
    const Eigen::Index count = sensitivity.cols();
    const int blocks = held_out.block_count();
    const double per_block = 2 * search.misfits(residuals).sum() / blocks;
    const VectorXd squared = search.squared(residuals);
    MatrixXd slopes = MatrixXd::Zero(count, blocks), curvature = MatrixXd::Zero(count, count);
    for (std::size_t s = 0; s < held_out.block_of().size(); ++s) {
        const int block = held_out.block_of()[s];
        const double weight = detail::robust_weight(std::sqrt(squared[block]), search.scale_mm());
        const auto rows = sensitivity.middleRows<3>(3 * Eigen::Index(s));
        slopes.col(block) += weight * rows.transpose() * residuals.col(Eigen::Index(s));
        curvature += weight * rows.transpose() * rows;
    }
    const MatrixXd one = MatrixXd::Identity(count, count);
    const double few = double(blocks) / std::max<double>(1, double(blocks - count));
    const MatrixXd scatter = few * slopes * slopes.transpose() / (per_block * per_block);
    const MatrixXd inverse = (curvature / per_block + one).inverse();
    return inverse * (scatter + one) * inverse;
}

Estimate estimate(Search& search, const detail::HeldOut& held_out, const std::vector<FitScalar>& scalars,
                  const std::vector<std::size_t>& active) {
    Estimate result;
    result.x = search.minimise(active);
    const Eigen::Matrix3Xd residuals = search.residuals(result.x);
    MatrixXd sensitivity(residuals.size(), Eigen::Index(active.size()));
    for (std::size_t k = 0; k < active.size(); ++k)
        sensitivity.col(Eigen::Index(k)) = derivative(search, scalars[active[k]], result.x, Eigen::Index(active[k]));
    result.covariance = covariance(search, held_out, sensitivity, residuals);
    const VectorXd after = search.misfits(residuals), gain = search.given_by_block() - after;
    const double scatter =
        std::sqrt(double(gain.size()) / double(gain.size() - 1)) * (gain.array() - gain.mean()).matrix().norm();
    result.misfit_ratio = after.sum() / search.given_by_block().sum();
    result.improvement = scatter > 0 ? gain.sum() / scatter : 0;
    return result;
}

std::string percent(double share) {
    return std::to_string(std::lround(100 * share)) + " %";
}

/// The verdicts on an estimate.
class Judgement {
public:
    Judgement(const std::vector<FitScalar>& scalars, const std::vector<std::size_t>& active, const Estimate& estimate,
              std::vector<FittedParameter>& results)
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
    const Estimate& estimate_;
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
                           detail::to_text(correlation) + ")");
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

std::vector<FittedParameter> unfitted(const std::vector<FitScalar>& scalars, const std::string& reason) {
    std::vector<FittedParameter> results;
    for (const FitScalar& scalar : scalars)
        results.push_back(
            {scalar.name, scalar.unit, scalar.given, scalar.given, scalar.slope(0), FitOutcome::NotSeen, reason});
    return results;
}

double scale_of(const FitOptions& options, const UpdateResult& result) {
    constexpr double deviations = 3, least_deviation_mm = 0.05;
    if (options.scale_mm > 0) return options.scale_mm;
    return deviations * std::max(least_deviation_mm, result.rounds.back().mean_residual_mm);
}

/// Fits all, then without those that the data do not tell, until the data tell the rest. Throws SolverFailure.
void fit_active(detail::HeldOut& held_out, const std::vector<FitScalar>& scalars, double scale_mm, ParameterFit& fit,
                Observer& observer) {
    Search search(held_out, scalars, {fit.materials, fit.loads}, scale_mm, observer);
    std::vector<std::size_t> active(scalars.size());
    for (std::size_t k = 0; k < active.size(); ++k) active[k] = k;
    while (!active.empty()) {
        const Estimate found = estimate(search, held_out, scalars, active);
        const std::vector<std::size_t> kept = Judgement(scalars, active, found, fit.parameters).kept();
        if (kept.size() == active.size()) {
            const detail::Tissue tissue = search.tissue(found.x);
            fit.materials = tissue.materials;
            fit.loads = tissue.loads;
            fit.misfit_ratio = found.misfit_ratio;
            break;
        }
        active = kept;
    }
}

int label_in(const std::string& name, std::size_t colon) {
    int label = 0;
    const char *first = name.data() + colon + 1, *end = name.data() + name.size();
    const auto read = std::from_chars(first, end, label);
    if (read.ptr != end || read.ec != std::errc() || label <= 0)
        throw InvalidInput("'" + name + "' names no label; write a positive number after the colon, as in " +
                           name.substr(0, colon) + ":2");
    return label;
}

}  // namespace

FitParameter fit_parameter(const std::string& name) {
    const std::size_t colon = name.find(':');
    const std::string kind = name.substr(0, colon);
    const int label = colon == std::string::npos ? 0 : label_in(name, colon);
    if (kind == "poissons-ratio") return {TissueParameter::PoissonsRatio, label, 0.1};
    if (kind == "stiffness-ratio" && label > 0) return {TissueParameter::StiffnessRatio, label, std::log(3.0)};
    if (kind == "gravity" && label == 0) return {TissueParameter::Gravity, 0, 1.0};
    if (kind == "pressure" && label == 0) return {TissueParameter::Pressure, 0, 0.3};
    throw InvalidInput("'" + name +
                       "' is no parameter that is fitted; give poissons-ratio, poissons-ratio:LABEL, "
                       "stiffness-ratio:LABEL, gravity or pressure");
}

std::string name_of(const FitParameter& parameter) {
    std::string label;
    if (parameter.label != 0) label.append(1, ':').append(std::to_string(parameter.label));
    switch (parameter.kind) {
        case TissueParameter::PoissonsRatio:
            return "poissons-ratio" + label;
        case TissueParameter::StiffnessRatio:
            return "stiffness-ratio" + label;
        case TissueParameter::Gravity:
            return "gravity";
        case TissueParameter::Pressure:
            break;
    }
    return "pressure";
}

bool ParameterFit::any_identified() const {
    return std::any_of(parameters.begin(), parameters.end(), [](const auto& each) { return each.identified(); });
}

ParameterFit fit_parameters(const PreparedModel& prepared, const UpdateResult& result, const UpdateOptions& update,
                            const FitOptions& options, Observer& observer) {
    detail::Stopwatch stopwatch;
    const std::vector<FitScalar> scalars = detail::fit_scalars(prepared, update.loads, options);
    ParameterFit fit;
    fit.materials = prepared.model.materials;
    fit.loads = update.loads;
    if (scalars.empty()) return fit;
    detail::HeldOut held_out(prepared, result, options);
    fit.blocks = held_out.block_count();
    fit.parameters = unfitted(scalars, "the data lie in " + std::to_string(fit.blocks) + " blocks of space; " +
                                           std::to_string(least_blocks) + " are needed to hold some out");
    if (fit.blocks < least_blocks) return fit;

    try {
        fit_active(held_out, scalars, scale_of(options, result), fit, observer);
    } catch (const SolverFailure&) {
        fit.parameters = unfitted(scalars, "tissue finds no equilibrium while part of the data is held out");
    }
    fit.equilibria = held_out.equilibria();
    fit.force_evaluations = held_out.force_evaluations();
    fit.seconds = stopwatch.lap("").seconds;
    return fit;
}

FittedUpdate update_and_fit(PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& options,
                            const FitOptions& fit_options, Observer& observer) {
    static_cast<void>(detail::fit_scalars(prepared, options.loads, fit_options));  // throws before the work
    FittedUpdate fitted{update(prepared, seen, options, observer), {}};
    fitted.fit = fit_parameters(prepared, fitted.result, options, fit_options, observer);
    if (!fitted.fit.any_identified()) return fitted;
    UpdateOptions with_loads = options;
    with_loads.loads = fitted.fit.loads;
    if (fitted.fit.materials != prepared.model.materials)
        prepared = with_materials(std::move(prepared), fitted.fit.materials);
    fitted.result = update(prepared, seen, with_loads, observer);
    return fitted;
}

}  // namespace tissuewarp::registration
