// tissuewarp study accuracy-time: what accuracy costs in time on this machine.

#include "apps/bench_engines.hpp"
#include "apps/progress.hpp"
#include "apps/study.hpp"
#include "apps/versions.hpp"
#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "study/accuracy_time.hpp"
#include "study/page.hpp"

#include <fmt/format.h>

#include <charconv>

namespace tissuewarp::apps {

namespace {

namespace fs = std::filesystem;

constexpr const char* repository_brain = "data/brainshift";

void require_folder(const fs::path& folder, const std::string& problem, const char* option) {
    std::error_code ignored;
    if (!fs::is_directory(folder, ignored))
        throw InvalidInput(fmt::format("the problem {} needs the folder '{}', which is not here; {}", problem,
                                       folder.string(), option));
}

std::uint64_t seed_of(const std::string& name) {
    std::uint64_t seed = 0;
    const std::string digits = name.substr(name.find(':') + 1);
    const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), seed);
    if (digits.empty() || error != std::errc() || stop != digits.data() + digits.size())
        throw InvalidInput("'" + name + "' in --problems is no phantom; write phantom:SEED with a whole number");
    return seed;
}

int gpu_index_of(const DeviceChoice& device) {
    return device.name.starts_with("gpu:") ? std::stoi(device.name.substr(4)) : -1;
}

study::BodyOptions body_options(const StudyOptions& options, int full, int quick) {
    study::BodyOptions body;
    body.reference_tetrahedra = options.quick ? quick : full;
    body.cache = options.output / "references";
    body.gpu_index = gpu_index_of(options.device);
    return body;
}

/// Checked before anything is measured; made when its turn comes.
study::NamedProblem problem_named(const std::string& name, const StudyOptions& options) {
    const int gpu = gpu_index_of(options.device);
    const char* here = "run where the repository's data lies";
    if (name == "cube")
        return {name, [body = body_options(options, 3000, 1000)](Observer&) {
                    return study::body_problem(study::stretched_cube(), body);
                }};
    if (name == "brain") {
        require_folder(repository_brain, name, here);
        return {name, [body = body_options(options, 12000, 4000)](Observer&) {
                    const auto labels = imaging::read_labels(fs::path(repository_brain) / "preop_labels.nii.gz");
                    return study::body_problem(study::indented_organ(labels), body);
                }};
    }
    if (name == "brainshift") {
        require_folder(repository_brain, name, here);
        return {name, [gpu, name](Observer&) {
                    return study::patient_problem(study::patient_of(repository_brain, name,
                                                                    "a cortex that sank by 9 mm under a craniotomy, "
                                                                    "registered from its label maps"),
                                                  gpu);
                }};
    }
    if (name == "liver") {
        const fs::path folder = options.data / "phantom-liver";
        require_folder(folder, name, "give --data, the folder that holds phantom-liver");
        return {name, [gpu, name, folder](Observer&) {
                    return study::patient_problem(
                        study::patient_of(folder, name,
                                          "a liver under pneumoperitoneum, registered from its label "
                                          "maps"),
                        gpu);
                }};
    }
    if (name.starts_with("phantom:")) {
        const std::uint64_t seed = seed_of(name);
        return {name, [gpu, seed](Observer& observer) {
                    return study::patient_problem(study::random_patient(seed, observer), gpu);
                }};
    }
    throw InvalidInput("'" + name +
                       "' in --problems is no problem; there are cube, brain, brainshift, liver and "
                       "phantom:SEED");
}

std::vector<study::NamedProblem> problems_of(const StudyOptions& options) {
    std::vector<std::string> names = options.problems;
    if (names.empty()) names = {"cube", "brain", "brainshift", "phantom:1", "phantom:2"};
    std::vector<study::NamedProblem> problems;
    for (const std::string& name : names) problems.push_back(problem_named(name, options));
    return problems;
}

/// The base's processor first. A software rasteriser counts only where it was asked for.
std::vector<tled::Processor> processors_of(const std::string& name, const std::optional<BenchDevice>& device) {
    if (!device || (name == "auto" && !device->hardware)) return {tled::Processor::Cpu};
    if (name == "auto") return {tled::Processor::Cpu, tled::Processor::Gpu};
    return {tled::Processor::Gpu, tled::Processor::Cpu};
}

study::Provenance provenance_of(const StudyOptions& options, const std::optional<BenchDevice>& device) {
    const auto cube = study::stretched_cube();
    tled::Model model;
    model.mesh = cube.mesh(6, silent_observer());
    model.materials[1] = study::material_of({});
    study::Provenance provenance{{"processor", tled::make_cpu_engine(tled::rest_state(model))->description()},
                                 {"plan", options.quick ? "quick" : "full"}};
    if (device) provenance["GPU"] = device->name;
    for (const auto& [name, version] : versions()) provenance["version of " + name] = version;
    return provenance;
}

void print_problem(const study::ProblemSummary& problem, const study::Store& store) {
    const study::Findings findings = study::findings_of(problem, store.points());
    fmt::print("\n{}: {}\n", problem.name, problem.story);
    for (const std::string& line : findings.lines) fmt::print("  {}\n", line);
}

}  // namespace

void run_accuracy_time_study(const StudyOptions& options) {
    if (options.output.empty()) throw InvalidInput("give --output, the folder for measurements and page");
    ProgressLine progress(options.common);
    const std::vector<study::NamedProblem> problems = problems_of(options);
    const std::optional<BenchDevice> device = bench_device(options.device.name);
    study::AccuracyTimeOptions study_options;
    study_options.plan.extent = options.quick ? study::Extent::Quick : study::Extent::Full;
    study_options.plan.most_elements = options.most_elements;
    study_options.plan.processors = processors_of(options.device.name, device);
    study_options.runs = options.repeats > 0 ? options.repeats : options.quick ? 2 : 5;
    require_writable_folder(options.output / "references");
    const study::Provenance provenance = provenance_of(options, device);
    study::Store store(options.output, provenance);
    const std::size_t before = store.points().size();
    const auto show = [&] { study::write_page(store.problems(), store.points(), provenance, options.output); };
    try {
        study::measure_accuracy_time(
            problems, study_options, store,
            [&](const std::string& words, double from, double to) { progress.begin(words, from, to); }, progress);
    } catch (const Cancelled&) {
        if (!store.points().empty()) show();
        throw Interrupted(fmt::format("interrupted; {} points are in '{}', and the same command goes on from there",
                                      store.points().size(), options.output.string()));
    }
    show();
    progress.clear();
    if (options.common.quiet) return;
    for (const study::ProblemSummary& problem : store.problems()) print_problem(problem, store);
    for (const std::string& note : progress.notes()) fmt::print("note: {}\n", note);
    fmt::print("\n{} points, {} of them measured now; {}\n", store.points().size(), store.points().size() - before,
               (options.output / "accuracy-time.html").string());
}

}  // namespace tissuewarp::apps
