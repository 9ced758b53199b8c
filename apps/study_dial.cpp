// tissuewarp study dial: whether --time-budget and --accuracy keep what they are asked for.

#include "apps/progress.hpp"
#include "apps/study.hpp"
#include "apps/update_device.hpp"
#include "core/errors.hpp"
#include "registration/dial/fronts_io.hpp"
#include "study/dial_trial.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace tissuewarp::apps {

namespace {

using study::DialTrial;

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

std::vector<DialTrial> measured(const StudyOptions& options, const study::DialTrialOptions& plan,
                                ProgressLine& progress) {
    try {
        return study::try_dial(options.output, registration::known_fronts(), plan, progress);
    } catch (const Cancelled&) {
        throw Interrupted("interrupted; the trials so far are in '" + options.output.string() +
                          "', and the same command goes on from there");
    }
}

}  // namespace

void run_dial_study(const StudyOptions& options) {
    study::DialTrialOptions plan;
    plan.update = on_device(options.device);
    std::tie(plan.first_seed, plan.last_seed) = phantom_seeds(options.problems, {plan.first_seed, plan.last_seed});
    if (options.quick) plan.last_seed = std::min(plan.last_seed, plan.first_seed + 1);
    if (options.output.empty()) throw InvalidInput("give --output, the folder that keeps each phantom's trials");
    ProgressLine progress(options.common);
    progress.begin("registering phantoms", 0.0, 1.0);
    const std::vector<DialTrial> trials = measured(options, plan, progress);
    progress.clear();
    for (const std::string& note : progress.notes()) fmt::print("note: {}\n", note);
    if (trials.empty()) throw SolverFailure("no phantom could be made; give other seeds");
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
