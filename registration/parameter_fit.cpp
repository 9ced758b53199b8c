// Which tissue and loads predict best what data show elsewhere, and how well the data tell.

#include "registration/parameter_fit.hpp"

#include "registration/detail/fit_judgement.hpp"
#include "registration/stopwatch.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace tissuewarp::registration {

namespace {

constexpr int least_blocks = 8;  // fewer say nothing of their own scatter

using detail::FitScalar;

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
    detail::FitSearch search(held_out, scalars, {fit.materials, fit.loads}, scale_mm, observer);
    std::vector<std::size_t> active(scalars.size());
    for (std::size_t k = 0; k < active.size(); ++k) active[k] = k;
    while (!active.empty()) {
        const detail::FitEstimate found = detail::estimate(search, held_out, scalars, active);
        const std::vector<std::size_t> kept = detail::told_by_data(scalars, active, found, fit.parameters);
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

namespace {

bool any(const TissueLoads& loads) {
    return loads.pressure_kpa != 0 || !loads.body_force.isZero(0);
}

}  // namespace

FittedUpdate update_and_fit(PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& options,
                            const FitOptions& fit_options, Observer& observer) {
    static_cast<void>(detail::fit_scalars(prepared, options.loads, fit_options));  // throws before the work
    FittedUpdate fitted{update(prepared, seen, options, observer), {}};
    fitted.fit = fit_parameters(prepared, fitted.result, options, fit_options, observer);
    if (!fitted.fit.any_identified()) return fitted;
    UpdateOptions with_loads = options;
    with_loads.loads = fitted.fit.loads;
    const bool other_tissue = fitted.fit.materials != prepared.model.materials;
    if (other_tissue) prepared = with_materials(std::move(prepared), fitted.fit.materials);
    fitted.result = update(prepared, seen, with_loads, observer);
    if (other_tissue && !any(with_loads.loads))
        fitted.result.doubts.emplace_back(
            "tissue was fitted while no load is known: a load that acts between the data passes for other tissue, and "
            "the stated deviation does not hold that; compare targets that nothing used with and without the fit");
    return fitted;
}

}  // namespace tissuewarp::registration
