#include "tled/equilibrium.hpp"

#include "tled/model/held_tissue.hpp"
#include "tled/statics/equilibrium_search.hpp"

#include <cmath>
#include <vector>

namespace tissuewarp::tled {

namespace {

struct Choice {
    EquilibriumMethod method;
    std::string reason;
};

void require_usable(const NodalConditions& conditions, const EquilibriumOptions& options,
                    const Eigen::Matrix3Xd* start) {
    if (!(options.tolerance_mm > 0) || !std::isfinite(options.tolerance_mm) || options.max_steps < 1)
        throw InvalidInput("equilibrium: the tolerance is " + std::to_string(options.tolerance_mm) + " mm and " +
                           std::to_string(options.max_steps) + " force evaluations are allowed; both must be positive");
    if (start != nullptr && (start->cols() != conditions.constrained.cols() || !start->allFinite()))
        throw InvalidInput("equilibrium: the start has " + std::to_string(start->cols()) + " columns for " +
                           std::to_string(conditions.constrained.cols()) + " nodes, or values that are not finite");
    if (!conditions.effects.surface.parting.empty())
        throw InvalidInput("equilibrium: some pairs may part, which it does not decide; take equilibrium_in_contact()");
    if (options.one_sided != nullptr && options.method != EquilibriumMethod::Newton)
        throw InvalidInput("equilibrium: contact that pushes alone takes Newton's method");
    if (options.rest != nullptr && options.one_sided == nullptr) detail::require_held(*options.rest, conditions);
}

/// By expected work in force evaluations: relaxation's from the lowest frequency, L-BFGS's from the size of the factor
/// (figures: docs/lab/performance.md, "Equilibrium to a given error").
Choice choose(const Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions) {
    if (engine.processor() == Processor::Gpu)
        return {EquilibriumMethod::SelfCheckedRelaxation, "on the GPU a solve with the factor outweighs all steps"};
    constexpr double highest = 8, decades = 4;  // of diag(K₀)⁻¹K₀; neper from a linear start to a tolerance
    constexpr double evaluations_per_entry = 7.5e-3;  // of a solve, by entries of the factor per node
    constexpr double iterations = 50;                 // 12 to 20 for ν = 0.49, 50 to 75 for 0.499
    const double steps = 0.5 * std::sqrt(highest / stiffness.lowest_eigenvalue()) * decades;
    const double solve = evaluations_per_entry * static_cast<double>(stiffness.factor_nonzeros()) /
                         static_cast<double>(std::max<Eigen::Index>(1, conditions.constrained.cols()));
    const std::string work = std::to_string(std::lround(steps)) + " relaxation steps against " +
                             std::to_string(std::lround(iterations)) + " solves worth " +
                             std::to_string(std::lround(solve)) + " force evaluations each";
    if (steps < iterations * (solve + 1)) return {EquilibriumMethod::DynamicRelaxation, work};
    return {EquilibriumMethod::Lbfgs, work};
}

/// Those to try one after the other.
std::vector<EquilibriumMethod> escalation(EquilibriumMethod first, const NodalConditions& conditions,
                                          const EquilibriumOptions& options) {
    std::vector<EquilibriumMethod> methods{first};
    if (first != EquilibriumMethod::Lbfgs) methods.push_back(EquilibriumMethod::Lbfgs);
    const bool decides = options.last == EquilibriumMethod::Newton && options.rest != nullptr;
    if (decides && !conditions.effects.contact) methods.push_back(EquilibriumMethod::Newton);
    return methods;
}

/// `search` with forces in float64; the engine is left where its answer is.
template <class Search>
EquilibriumResult precisely(Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions,
                            const EquilibriumOptions& options, Observer& observer, const Search& search) {
    const auto precise = make_cpu_engine(*options.rest, Scalar::Float64);
    detail::EquilibriumSearch with_float64(*precise, stiffness, conditions, options, observer);
    EquilibriumResult result = search(with_float64);
    engine.set_conditions(conditions);
    engine.set_state(result.displacement, Eigen::Matrix3Xd::Zero(3, result.displacement.cols()));
    return result;
}

EquilibriumResult by_newton(Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions,
                            const EquilibriumOptions& options, const Eigen::Matrix3Xd* start, Observer& observer) {
    if (options.rest == nullptr) throw InvalidInput("equilibrium: Newton's method takes the rest state");
    return precisely(engine, stiffness, conditions, options, observer, [&](detail::EquilibriumSearch& search) {
        if (options.tangent != nullptr) return detail::newton(search, start, *options.tangent);
        detail::TangentFactor tangent(*options.rest, conditions.constrained);
        return detail::newton(search, start, tangent);
    });
}

/// A method that was asked for stays alone; on a GPU K₀ is not factorised; loads that follow the surface are not in the
/// tangent.
bool tangent_judges(const Engine& engine, const NodalConditions& conditions, const EquilibriumOptions& options) {
    const NodalEffects& effects = conditions.effects;
    return options.method == EquilibriumMethod::Automatic && options.rest != nullptr &&
           engine.processor() == Processor::Cpu && !effects.contact && !effects.fluid &&
           effects.surface.pressure_faces.cols() == 0;
}

EquilibriumResult solve(EquilibriumMethod method, Engine& engine, const RestStiffness& stiffness,
                        const NodalConditions& conditions, const EquilibriumOptions& options,
                        const Eigen::Matrix3Xd* start, Observer& observer) {
    if (method == EquilibriumMethod::Newton) return by_newton(engine, stiffness, conditions, options, start, observer);
    detail::EquilibriumSearch search(engine, stiffness, conditions, options, observer);
    if (method == EquilibriumMethod::DynamicRelaxation) return detail::dynamic_relaxation(search, start);
    if (method == EquilibriumMethod::SelfCheckedRelaxation) return detail::self_checked_relaxation(search, start);
    return detail::lbfgs(search, start);
}

}  // namespace

const char* name_of(EquilibriumMethod method) {
    switch (method) {
        case EquilibriumMethod::Lbfgs:
            return "L-BFGS";
        case EquilibriumMethod::DynamicRelaxation:
            return "dynamic relaxation";
        case EquilibriumMethod::SelfCheckedRelaxation:
            return "self-checked relaxation";
        case EquilibriumMethod::Newton:
            return "Newton's method";
        case EquilibriumMethod::Automatic:
            break;
    }
    return "automatic";
}

EquilibriumResult equilibrium(Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions,
                              const EquilibriumOptions& options, const Eigen::Matrix3Xd* start, Observer& observer) {
    require_usable(conditions, options, start);
    const bool automatic = options.method == EquilibriumMethod::Automatic;
    Choice choice{options.method, "asked for"};
    if (automatic) {
        choice = choose(engine, stiffness, conditions);
        observer.note(std::string("equilibrium by ") + name_of(choice.method) + ": " + choice.reason);
    }
    const auto run = [&](EquilibriumMethod method) {
        EquilibriumResult result = solve(method, engine, stiffness, conditions, options, start, observer);
        result.method = method;
        result.reason = choice.reason;
        return result;
    };
    if (!automatic) return run(choice.method);
    const std::vector<EquilibriumMethod> methods = escalation(choice.method, conditions, options);
    for (std::size_t n = 0; n + 1 < methods.size(); ++n) {
        try {
            return run(methods[n]);
        } catch (const SolverFailure& failure) {
            choice.reason = std::string(name_of(methods[n])) + " failed (" + failure.what() + ")";
            observer.note(std::string("equilibrium by ") + name_of(methods[n + 1]) + ": " + choice.reason);
        }
    }
    return run(methods.back());
}

EquilibriumResult judged_by_tangent(Engine& engine, const RestStiffness& stiffness, const NodalConditions& conditions,
                                    const EquilibriumOptions& options, EquilibriumResult found, Observer& observer) {
    if (found.method == EquilibriumMethod::Newton || !tangent_judges(engine, conditions, options)) return found;
    const auto refine = [&](detail::EquilibriumSearch& search) {
        return detail::refinement(search, found.displacement);
    };
    EquilibriumMethod method = found.method;
    EquilibriumResult result;
    try {
        result = precisely(engine, stiffness, conditions, options, observer, refine);
    } catch (const SolverFailure&) {
        method = EquilibriumMethod::Newton;
        result = by_newton(engine, stiffness, conditions, options, &found.displacement, observer);
    }
    result.force_evaluations += found.force_evaluations;
    result.lifted_residuals += found.lifted_residuals;
    result.method = method;
    result.reason = std::move(found.reason);
    return result;
}

}  // namespace tissuewarp::tled
