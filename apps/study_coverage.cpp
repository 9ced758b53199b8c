// tissuewarp study coverage: whether the intervals of error estimates hold.

#include "apps/progress.hpp"
#include "apps/study.hpp"
#include "apps/update_device.hpp"
#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "study/coverage_summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

namespace tissuewarp::apps {

namespace {

std::vector<study::CoverageRow> measured(const StudyOptions& options, const study::CoverageOptions& plan,
                                         ProgressLine& progress) {
    try {
        return study::measured_coverage(options.output, plan, progress);
    } catch (const Cancelled&) {
        throw Interrupted("interrupted; the phantoms so far are in '" + options.output.string() +
                          "', and the same command goes on from there");
    }
}

}  // namespace

void run_coverage_study(const StudyOptions& options) {
    if (options.output.empty()) throw InvalidInput("give --output, the folder that keeps each phantom's measurements");
    study::CoverageOptions plan;
    plan.update = on_device(options.device);
    std::tie(plan.first_seed, plan.last_seed) = phantom_seeds(options.problems, {plan.first_seed, plan.last_seed});
    if (options.quick) plan.last_seed = std::min(plan.last_seed, plan.first_seed + 1);
    ProgressLine progress(options.common.quiet);
    progress.begin("registering phantoms", 0.0, 1.0);
    const auto coverage = study::coverage_of(measured(options, plan, progress));
    progress.clear();
    if (coverage.empty()) throw SolverFailure("no phantom could be registered; give other seeds");
    write_file(study::coverage_figure(coverage), options.output / "coverage.svg");
    fmt::print("{}", study::table_of(coverage));
}

}  // namespace tissuewarp::apps
