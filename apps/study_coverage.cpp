// tissuewarp study coverage: whether the intervals of error estimates hold.

#include "apps/displacement_field.hpp"
#include "apps/progress.hpp"
#include "apps/study.hpp"
#include "apps/update_device.hpp"
#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "study/coverage_summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

namespace tissuewarp::apps {

namespace {

/// "bent:7-9" → Bent and "phantom:7-9", which phantom_seeds() reads.
std::pair<study::Family, std::vector<std::string>> family_of(std::vector<std::string> problems) {
    using study::Family;
    for (const auto& [name, family] :
         {std::pair{"bent:", Family::Bent}, std::pair{"organ:", Family::Labelled}, std::pair{"found:", Family::Found},
          std::pair{"resected:", Family::Resected}, std::pair{"unresected:", Family::Unresected},
          std::pair{"opened:", Family::Opened}, std::pair{"bulged:", Family::Bulged}})
        if (problems.size() == 1 && problems.front().starts_with(name)) {
            problems.front().replace(0, std::string(name).size(), "phantom:");
            return {family, std::move(problems)};
        }
    return {Family::Solved, std::move(problems)};
}

/// "ultrasound:7-9": organs that navigation puts near to where they are, seen by ultrasound alone.
/// "tracked-ultrasound:7-9": the same by frames of a probe in a hand.
/// "faint-ultrasound:7-9": the same of bent organs, whose echoes the first image explains less.
void take_ultrasound(std::vector<std::string>& problems, study::CoverageOptions& plan) {
    constexpr std::string_view clear = "ultrasound:", tracked = "tracked-ultrasound:", faint = "faint-ultrasound:";
    constexpr study::Misplacement of_navigation{4, 4};
    if (problems.size() != 1) return;
    std::string& problem = problems.front();
    if (problem.starts_with(clear))
        problem.replace(0, clear.size(), "phantom:");
    else if (problem.starts_with(tracked)) {
        problem.replace(0, tracked.size(), "phantom:");
        plan.phantom.echoes.tracked = true;
        plan.update.image.similarity = registration::Similarity::LinearCombination;  // as `compound` advises
    } else if (problem.starts_with(faint)) {
        problem.replace(0, faint.size(), "bent:");
        plan.phantom.echoes = study::faint_echoes;
    } else
        return;
    plan.phantom.misplacement = of_navigation;
    plan.evidence = {study::Evidence::Ultrasound};
}

/// "sought:7-9": patients as "resected:7-9", of whom nobody tells what is gone, to be found in an image.
/// "untold:7-9": the same whom the program takes to be whole.
void take_untold(std::vector<std::string>& problems, study::CoverageOptions& plan) {
    constexpr std::string_view sought = "sought:", untold = "untold:";
    if (problems.size() != 1) return;
    std::string& problem = problems.front();
    if (problem.starts_with(sought)) {
        problem.replace(0, sought.size(), "resected:");
        plan.resection = study::KnownOfResection::Sought;
        plan.evidence = {study::Evidence::Image};
    } else if (problem.starts_with(untold)) {
        problem.replace(0, untold.size(), "resected:");
        plan.resection = study::KnownOfResection::Untold;
    }
}

/// "turned:7-9": patients as "bent:7-9" that headers place anyhow, as labels show them.
void take_turned(std::vector<std::string>& problems, study::CoverageOptions& plan) {
    constexpr std::string_view name = "turned:";
    if (problems.size() != 1 || !problems.front().starts_with(name)) return;
    problems.front().replace(0, name.size(), "bent:");
    plan.phantom.misplacement = {180, 20};
    plan.evidence = {study::Evidence::Labels};
}

study::Evidence evidence_of(const std::string& name) {
    std::vector<std::string> names;
    for (const study::Evidence each : study::all_evidence) {
        if (name == name_of(each)) return each;
        names.emplace_back(name_of(each));
    }
    throw InvalidInput(fmt::format("--evidence '{}' is no kind of data; there are: {}", name, fmt::join(names, ", ")));
}

}  // namespace

study::CoverageOptions coverage_plan(const StudyOptions& options, Observer& observer) {
    study::CoverageOptions plan;
    plan.update = on_device(options.device);
    std::vector<std::string> wanted = options.problems;
    take_ultrasound(wanted, plan);
    take_untold(wanted, plan);
    take_turned(wanted, plan);
    const auto [family, problems] = family_of(std::move(wanted));
    plan.phantom.family = family;
    std::tie(plan.first_seed, plan.last_seed) = phantom_seeds(problems, {plan.first_seed, plan.last_seed});
    if (options.quick) plan.last_seed = std::min(plan.last_seed, plan.first_seed + 1);
    if (!options.evidence.empty()) plan.evidence.clear();
    for (const std::string& name : options.evidence) plan.evidence.push_back(evidence_of(name));
    if (family != study::Family::Labelled && family != study::Family::Found) return plan;
    if (options.organs.empty()) throw InvalidInput("give --organs, the label map whose organs are bent");
    plan.phantom.organs = imaging::read_labels(options.organs);
    if (family != study::Family::Found) return plan;
    if (options.fields.empty()) throw InvalidInput("give --fields, the displacement fields that bend organs");
    for (const std::string& field : options.fields) plan.phantom.fields.push_back(read_displacement(field, observer));
    return plan;
}

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
    ProgressLine progress(options.common);
    const study::CoverageOptions plan = coverage_plan(options, progress);
    progress.begin("registering phantoms", 0.0, 1.0);
    const auto coverage = study::coverage_of(measured(options, plan, progress));
    progress.clear();
    for (const std::string& note : progress.notes()) fmt::print("note: {}\n", note);
    if (coverage.empty()) throw SolverFailure("no phantom could be registered; give other seeds");
    write_file(study::coverage_figure(coverage), options.output / "coverage.svg");
    fmt::print("{}", study::table_of(coverage));
}

}  // namespace tissuewarp::apps
