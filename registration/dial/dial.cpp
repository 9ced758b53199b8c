#include "registration/dial/dial.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace tissuewarp::registration {

namespace {

std::string digits(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    return text;
}

void require_positive(const std::optional<double>& value, const char* name, const char* unit) {
    if (value && !(*value > 0 && std::isfinite(*value)))
        throw InvalidInput(std::string(name) + " " + std::to_string(*value) + " " + unit + "; give a number above 0");
}

/// Seconds beside the rounds.
struct FixedCosts {
    double before_s, after_s;
};

FixedCosts fixed_costs(const Fronts& fronts, const DialCase& what, const FrontPoint& point) {
    const LinearCost& alignment = fronts.alignment[static_cast<int>(what.kind)];
    return {alignment.at(what.fixed_label_megavoxels),
            point.fields_s + fronts.fields.at(what.moving_megavoxels + what.output_megavoxels) +
                fronts.warp.at(what.output_megavoxels)};
}

DialChoice choice_of(const Fronts& fronts, const DialRequest& request, const DialCase& what, const FrontPoint& point) {
    const FixedCosts costs = fixed_costs(fronts, what, point);
    DialChoice choice;
    choice.edge_length_mm = what.organ_mm / point.edges_per_organ;
    choice.point = point;
    choice.seconds = costs.before_s + point.rounds_s + costs.after_s;
    choice.error_mm = point.error_mm;
    choice.error_95_mm = point.error_95_mm;
    choice.accuracy_met = !request.accuracy_mm || point.error_95_mm <= *request.accuracy_mm;
    if (!request.time_s) return choice;
    choice.time_met = costs.before_s + point.rounds_95_s + costs.after_s <= *request.time_s;
    choice.update_budget_s = std::max(1e-3, *request.time_s - costs.after_s);
    return choice;
}

std::string reason_of(const Fronts& fronts, const DialRequest& request, const DialChoice& choice) {
    std::string text = "edges of " + digits(choice.edge_length_mm) + " mm should take " + digits(choice.seconds) +
                       " s and leave " + digits(choice.error_mm) +
                       " mm (95 % of phantoms: " + digits(choice.error_95_mm) + " mm)";
    if (!choice.accuracy_met)
        text += "; " + digits(*request.accuracy_mm) + " mm is not to be expected of such data with any mesh" +
                std::string(request.time_s ? " that keeps the time" : "");
    if (!choice.time_met) text += "; " + digits(*request.time_s) + " s is too short, and rounds may be cut";
    return text + (fronts.measured_here ? ", as measured on this machine"
                                        : ", by figures of another machine (" + fronts.machine +
                                              "); 'tissuewarp calibrate' measures here");
}

/// Fastest first.
std::vector<DialChoice> choices(const Fronts& fronts, const DialRequest& request, const DialCase& what) {
    std::vector<DialChoice> all;
    for (const FrontPoint& point : fronts.points)
        if (point.kind == what.kind) all.push_back(choice_of(fronts, request, what, point));
    if (all.empty())
        throw InvalidInput(std::string("no figures for registrations with ") + name_of(what.kind) +
                           "; run 'tissuewarp calibrate', or give --edge-length");
    std::stable_sort(all.begin(), all.end(),
                     [](const DialChoice& a, const DialChoice& b) { return a.seconds < b.seconds; });
    return all;
}

/// Of those within 5 % of the least error, which measurements hardly tell apart, the finest, which follows thin
/// structures as phantoms do not have them; where no time was given, of those that take at most twice as long as the
/// fastest. `all` is sorted by time and not empty.
const DialChoice& most_accurate(const std::vector<DialChoice>& all, bool time_given) {
    double least = all.front().error_95_mm;
    for (const DialChoice& choice : all) least = std::min(least, choice.error_95_mm);
    const DialChoice *fastest = nullptr, *finest = nullptr;
    for (const DialChoice& choice : all) {
        if (choice.error_95_mm > 1.05 * least) continue;
        if (fastest == nullptr) fastest = finest = &choice;
        if (!time_given && choice.seconds > 2 * fastest->seconds) continue;
        if (choice.edge_length_mm < finest->edge_length_mm) finest = &choice;
    }
    return *finest;
}

}  // namespace

std::optional<DataKind> data_kind(const Intraoperative& seen) {
    if (seen.labels) return DataKind::Labels;
    if (seen.surface || seen.points || seen.curves) return DataKind::Partial;
    return std::nullopt;
}

const char* name_of(DataKind kind) {
    return kind == DataKind::Labels ? "labels" : "partial";
}

DialChoice choose(const Fronts& fronts, const DialRequest& request, const DialCase& what) {
    require_positive(request.accuracy_mm, "accuracy", "mm");
    require_positive(request.time_s, "time budget", "s");
    if (!request.accuracy_mm && !request.time_s)
        throw InvalidInput("nothing to choose a mesh by; give an accuracy or a time budget");
    const std::vector<DialChoice> all = choices(fronts, request, what);
    std::vector<DialChoice> in_time;
    std::copy_if(all.begin(), all.end(), std::back_inserter(in_time), [](const DialChoice& c) { return c.time_met; });
    DialChoice chosen = in_time.empty() ? all.front() : most_accurate(in_time, request.time_s.has_value());
    if (request.accuracy_mm)
        for (const DialChoice& candidate : in_time)
            if (candidate.accuracy_met) {
                chosen = candidate;
                break;
            }
    chosen.reason = reason_of(fronts, request, chosen);
    return chosen;
}

}  // namespace tissuewarp::registration
