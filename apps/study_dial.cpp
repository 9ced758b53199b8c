// tissuewarp study dial: whether --time-budget and --accuracy keep what they are asked for.

#include "apps/point_files.hpp"
#include "apps/progress.hpp"
#include "apps/study.hpp"
#include "apps/update_device.hpp"
#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "registration/fronts_io.hpp"
#include "study/dial_trial.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace tissuewarp::apps {

namespace {

using study::DialTrial;

/// "phantom:7001-7050".
void read_seeds(const StudyOptions& options, study::DialTrialOptions& plan) {
    if (options.problems.empty()) return;
    const std::string& text = options.problems.front();
    const std::string prefix = "phantom:";
    const char* end = text.data() + text.size();
    const char* at = text.data() + std::min(prefix.size(), text.size());
    const auto first = std::from_chars(at, end, plan.first_seed);
    plan.last_seed = plan.first_seed;
    auto last = first;
    if (first.ptr != end && *first.ptr == '-') last = std::from_chars(first.ptr + 1, end, plan.last_seed);
    if (options.problems.size() > 1 || !text.starts_with(prefix) || first.ec != std::errc() || last.ec != std::errc() ||
        last.ptr != end || plan.last_seed < plan.first_seed)
        throw InvalidInput("--problems '" + text + "' are no phantoms; write for instance phantom:7001-7050");
}

void write_table(const std::vector<DialTrial>& trials, const std::filesystem::path& path) {
    std::vector<Column> columns;
    const auto column = [&](const char* name, auto value) {
        Eigen::VectorXd values(static_cast<Eigen::Index>(trials.size()));
        for (std::size_t t = 0; t < trials.size(); ++t) values[Eigen::Index(t)] = double(value(trials[t]));
        columns.push_back({name, values});
    };
    column("seed", [](const DialTrial& t) { return t.seed; });
    column("partial_data", [](const DialTrial& t) { return t.kind == registration::DataKind::Partial; });
    column("time_budget_s", [](const DialTrial& t) { return t.request.time_s.value_or(0); });
    column("accuracy_mm", [](const DialTrial& t) { return t.request.accuracy_mm.value_or(0); });
    column("edge_length_mm", [](const DialTrial& t) { return t.edge_length_mm; });
    column("expected_s", [](const DialTrial& t) { return t.expected_s; });
    column("seconds", [](const DialTrial& t) { return t.seconds; });
    column("error_mm", [](const DialTrial& t) { return t.error_mm; });
    column("estimated_mm", [](const DialTrial& t) { return t.estimated_mm; });
    column("possible", [](const DialTrial& t) { return t.possible; });
    column("announced", [](const DialTrial& t) { return t.announced; });
    write_columns(columns, path);
}

double percentile_95(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(std::ceil(0.95 * double(values.size()))) - 1];
}

template <class Condition>
double share(const std::vector<DialTrial>& trials, Condition holds) {
    return double(std::count_if(trials.begin(), trials.end(), holds)) / double(trials.size());
}

void print_request(const std::vector<DialTrial>& trials) {
    const DialTrial& first = trials.front();
    std::vector<double> ratios;
    for (const DialTrial& t : trials) ratios.push_back(t.request.time_s ? t.seconds / *t.request.time_s : 0);
    if (first.request.time_s) {
        fmt::print(
            "{:<8} {:>5g} s   {:>3} runs: 95th percentile {:.0f} % of the budget, within 110 % {:.0f} %, "
            "possible by the figures {:.0f} %\n",
            name_of(first.kind), *first.request.time_s, trials.size(), 100 * percentile_95(ratios),
            100 * share(trials, [](const DialTrial& t) { return t.kept_time(); }),
            100 * share(trials, [](const DialTrial& t) { return t.possible; }));
        return;
    }
    fmt::print("{:<8} {:>5g} mm  {:>3} runs: met {:.0f} %, met or announced {:.0f} %, announced though met {:.0f} %\n",
               name_of(first.kind), *first.request.accuracy_mm, trials.size(),
               100 * share(trials, [](const DialTrial& t) { return t.kept_accuracy(); }),
               100 * share(trials, [](const DialTrial& t) { return t.kept_accuracy() || t.announced; }),
               100 * share(trials, [](const DialTrial& t) { return t.kept_accuracy() && t.announced; }));
}

}  // namespace

void run_dial_study(const StudyOptions& options) {
    study::DialTrialOptions plan;
    plan.update = on_device(options.device);
    read_seeds(options, plan);
    if (options.quick) plan.last_seed = std::min(plan.last_seed, plan.first_seed + 1);
    if (!options.output.empty()) require_writable_folder(options.output);
    ProgressLine progress(options.common.quiet);
    progress.begin("registering phantoms", 0.0, 1.0);
    const auto trials = study::try_dial(registration::known_fronts(), plan, progress);
    progress.clear();
    if (trials.empty()) throw SolverFailure("no phantom could be made; give other seeds");
    if (!options.output.empty()) write_table(trials, options.output / "dial.csv");
    std::vector<std::vector<DialTrial>> groups;
    for (const DialTrial& trial : trials) {
        const auto group = std::find_if(groups.begin(), groups.end(), [&](const auto& g) {
            return g.front().kind == trial.kind && g.front().request.time_s == trial.request.time_s &&
                   g.front().request.accuracy_mm == trial.request.accuracy_mm;
        });
        if (group == groups.end())
            groups.push_back({trial});
        else
            group->push_back(trial);
    }
    for (const auto& group : groups) print_request(group);
}

}  // namespace tissuewarp::apps
