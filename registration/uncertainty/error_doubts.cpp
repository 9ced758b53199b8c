// What an error estimate says against a result: see uncertainty.hpp.
#include "registration/doubts.hpp"
#include "registration/uncertainty.hpp"

#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

namespace tissuewarp::registration {

std::optional<Doubt> doubt_of_solver(const UncertaintySummary& summary, double tolerance_mm) {
    if (summary.algebraic_mm <= tolerance_mm) return std::nullopt;
    char text[160];
    std::snprintf(text, sizeof text,
                  "the solver stopped %.2g mm (root mean square) from equilibrium, where %.2g mm were asked for",
                  summary.algebraic_mm, tolerance_mm);
    return Doubt{"solver.short", summary.algebraic_mm, tolerance_mm, text};
}

std::optional<Doubt> doubt_of_data(const UncertaintySummary& summary) {
    constexpr DataDoubtLimits limits = data_doubt_limits;
    const bool failed = summary.failed_share > limits.failed_share;
    if (!failed && summary.poor_share <= limits.poor_share) return std::nullopt;
    const double share = failed ? summary.failed_share : summary.poor_share,
                 limit = failed ? limits.failed_share : limits.poor_share,
                 apart_mm = failed ? limits.failed_mm : limits.poor_mm;
    const std::string worst = std::isfinite(summary.worst_interval_mm)
                                  ? ", and the place known least " + detail::to_text(summary.worst_interval_mm) + " mm"
                                  : "";
    return Doubt{"data.show_too_little", share, limit,
                 "the data show too little of the organ: " + detail::percent(share) +
                     " of its tissue may lie more than " + std::to_string(int(apart_mm)) + " mm off" + worst,
                 "show more of it, or give landmarks"};
}

std::optional<Doubt> doubt_of_held_out(const HeldOut& held_out) {
    constexpr double most_z = held_out_doubt_limits.most_z;
    if (held_out.z <= most_z) return std::nullopt;
    char text[320];
    std::snprintf(text, sizeof text,
                  "the data contradict each other: left out in turn and predicted from the rest, %d regions of them "
                  "were missed by %.1f times what was to be expected; the stated errors are widened by as much, look "
                  "where data and result differ, and leave out what is not of this organ",
                  held_out.regions, held_out.z);
    return Doubt{"data.contradict", held_out.z, most_z, text};
}

std::vector<Doubt> doubts_of(const Uncertainty& uncertainty, double tolerance_mm) {
    const UncertaintySummary summary = summarise(uncertainty);
    std::vector<Doubt> doubts;
    if (auto doubt = doubt_of_solver(summary, tolerance_mm)) doubts.push_back(std::move(*doubt));
    if (uncertainty.held_out())
        if (auto doubt = doubt_of_held_out(*uncertainty.held_out())) doubts.push_back(std::move(*doubt));
    if (auto doubt = doubt_of_data(summary)) doubts.push_back(std::move(*doubt));
    return doubts;
}

std::optional<Doubt> doubt_of_accuracy(const UncertaintySummary& summary, double accuracy_mm) {
    if (summary.interval_mm <= accuracy_mm) return std::nullopt;
    char text[256];
    std::snprintf(text, sizeof text,
                  "%.3g mm were asked for, and errors are within %.3g mm with a probability of 95 %% (1 σ: %.3g mm, of "
                  "which the data leave %.3g mm and the mesh %.3g mm); %s",
                  accuracy_mm, summary.interval_mm, summary.deviation_mm, summary.data_mm, summary.discretisation_mm,
                  summary.data_mm > summary.discretisation_mm ? "more or better data would help, a finer mesh would not"
                                                              : "a finer mesh would help");
    return Doubt{"accuracy.not_sure", summary.interval_mm, accuracy_mm, text};
}

}  // namespace tissuewarp::registration
