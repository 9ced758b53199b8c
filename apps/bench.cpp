// tissuewarp bench: the two studies of Taylor, Cheng, Ourselin (2007) and how the engines scale, on this machine.

#include "apps/bench_outputs.hpp"
#include "apps/bench_timing.hpp"
#include "apps/cpu_ceilings.hpp"
#include "apps/output_folder.hpp"
#include "apps/progress.hpp"
#include "apps/report_json.hpp"
#include "apps/verbs.hpp"
#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "imaging/labels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tissuewarp::apps {

namespace {

/// A study with the sizes of its meshes and how they are timed.
struct PlannedStudy {
    Study study;
    std::vector<int> elements;
    TimingPlan timing;
};

constexpr const char* repository_labels = "data/brainshift/preop_labels.nii.gz";

std::filesystem::path brain_labels(const BenchOptions& options) {
    if (!options.labels.empty()) return options.labels;
    std::error_code ignored;
    return std::filesystem::exists(repository_labels, ignored) ? repository_labels : "";
}

std::vector<int> default_elements(Study study, bool quick) {
    switch (study) {
        case Study::Cube:  // 10 to 24 cells an edge
            return quick ? std::vector{750, 3072} : std::vector{6000, 10368, 16464, 24576, 34992, 48000, 63888, 82944};
        case Study::Brain:
            return quick ? std::vector{1500} : std::vector{11168, 25017, 46655};
        case Study::Scaling:  // 24 to 119 cells an edge
            break;
    }
    return quick ? std::vector{1296, 6000}
                 : std::vector{82944, 196608, 511104, 998250, 2058000, 3951018, 6556362, 10110954};
}

TimingPlan timing_plan(const BenchOptions& options, Study study) {
    TimingPlan plan{.repeats = options.repeats, .steps = options.steps, .compared_steps = options.steps};
    if (study == Study::Scaling) {
        plan.longest_step = 0.1;
        plan.compared_steps = std::min(options.steps, 100);
    }
    if (options.quick) {
        plan.steps = plan.compared_steps = std::min(options.steps, 50);
        plan.run_seconds = 0.1;
        plan.warm_up_seconds = 0;
    }
    return plan;
}

std::vector<PlannedStudy> planned(const BenchOptions& options, std::vector<std::string>& notes) {
    std::vector<PlannedStudy> studies;
    for (const Study study : {Study::Cube, Study::Brain, Study::Scaling}) {
        if (options.study != "all" && options.study != name_of(study)) continue;
        if (study == Study::Brain && brain_labels(options).empty()) {
            const std::string missing =
                fmt::format("no label map for the brain: there is no {} here; give --labels", repository_labels);
            if (options.study == "brain") throw InvalidInput(missing);
            notes.push_back("the brain was left out, " + missing);
            continue;
        }
        studies.push_back({study, options.elements.empty() ? default_elements(study, options.quick) : options.elements,
                           timing_plan(options, study)});
        std::sort(studies.back().elements.begin(), studies.back().elements.end());
    }
    return studies;
}

std::vector<BenchEngine> engines_of(const BenchOptions& options, const std::optional<BenchDevice>& device,
                                    std::vector<std::string>& notes) {
    std::vector<BenchEngine> engines;
    for (const BenchEngine engine : every_bench_engine) {
        const bool named =
            std::find(options.engines.begin(), options.engines.end(), name_of(engine)) != options.engines.end();
        if (!options.engines.empty() && !named) continue;
        if (processor_of(engine) == tled::Processor::Cpu || device) {
            engines.push_back(engine);
            continue;
        }
        const std::string missing = "engine " + name_of(engine) + " needs an OpenGL device, and there is none";
        if (named) throw InvalidInput(missing + " with --device " + options.device.name);
        notes.push_back(missing);
    }
    return engines;
}

/// One run of the verb.
class Benchmark {
public:
    Benchmark(const BenchOptions& options, ProgressLine& progress) : options_(options), progress_(progress) {
        for (const std::string& name : options.engines) engine_named(name);  // refuses what does not exist
        results_.repeats = options.repeats;
        results_.device = bench_device(options.device.name);
        engines_ = engines_of(options, results_.device, results_.notes);
        studies_ = planned(options, results_.notes);
        for (const PlannedStudy& study : studies_)
            for (const int elements : study.elements) all_work_ += work_of(elements);
        if (has(Study::Brain)) {
            labels_ = imaging::read_labels(brain_labels(options));
            imaging::require_labels(labels_, options.only, brain_labels(options).string().c_str());
        }
    }

    BenchResults run() {
        progress_.begin("ceilings", 0, 0.02);
        results_.ceilings[tled::Processor::Cpu] = measured_cpu_ceilings();
        results_.cpu = tled::make_cpu_engine(stretched_cube(1).rest)->description();
        if (results_.device)
            results_.ceilings[tled::Processor::Gpu] =
                shaders::measured_ceilings(shaders::Device(results_.device->index), options_.quick ? 0.0 : 1.0);
        show([&] { print_head(results_); });
        for (const PlannedStudy& study : studies_) {
            results_.studies.push_back(measured(study));
            show([&] { print_study(results_, results_.studies.back()); });
        }
        show([&] { print_limits(results_); });
        return std::move(results_);
    }

private:
    /// For the percent alone: larger meshes take longer, the smallest not nothing.
    static double work_of(int elements) { return 20000.0 + elements; }
    [[nodiscard]] bool has(Study study) const {
        return std::any_of(studies_.begin(), studies_.end(), [&](const auto& each) { return each.study == study; });
    }

    template <class Print>
    void show(const Print& print) {
        progress_.clear();
        if (!options_.common.quiet) print();
    }

    StudyResults measured(const PlannedStudy& study) {
        StudyResults results{study.study, {}};
        std::vector<BenchEngine> engines = engines_;
        for (const int elements : study.elements) {
            const double from = 0.02 + 0.98 * done_work_ / all_work_, share = 0.98 * work_of(elements) / all_work_;
            const std::string name = fmt::format("{} {}", name_of(study.study), elements);
            progress_.begin(name, from, from + 0.2 * share);
            const BenchScene scene = study.study == Study::Brain
                                         ? indented_brain(brain_mesh(labels_, options_.only, elements, progress_))
                                         : stretched_cube(cells_for(elements));
            MeshTimings mesh = run(scene, study.timing, engines, name, from + 0.2 * share, from + share);
            if (!mesh.engines.empty()) results.meshes.push_back(std::move(mesh));
            done_work_ += work_of(elements);
            if (engines.empty()) break;
        }
        return results;
    }

    /// Takes engines that are too slow for the mesh, or whose device is too small, from the list.
    MeshTimings run(const BenchScene& scene, TimingPlan plan, std::vector<BenchEngine>& engines,
                    const std::string& name, double from, double to) {
        constexpr int least_refused = 1'000'000;  // elements: smaller meshes fit into the memory of every device
        constexpr int most_compared = 1'100'000;  // elements: float64 and the scalar loops take minutes beyond
        if (scene.rest.element_count() > most_compared) plan.compared_steps = 0;
        const SceneReference reference = scene_reference(scene, plan, progress_);
        MeshTimings mesh{
            scene.rest.element_count(), scene.rest.node_count, reference.critical_step, reference.time_step, {}};
        const double share = (to - from) / double(engines.size());
        const BenchDevice device = results_.device.value_or(BenchDevice{});
        std::erase_if(engines, [&](BenchEngine engine) {
            progress_.begin(name + " " + name_of(engine), from, from + share);
            from += share;
            try {
                std::optional<EngineTiming> timing = timed(engine, scene, reference, device, plan, progress_);
                if (timing) {
                    mesh.engines.push_back(std::move(*timing));
                    return false;
                }
                results_.notes.push_back(fmt::format("{} stops before {} elements: a step takes more than {} s",
                                                     name_of(engine), mesh.elements, plan.longest_step));
            } catch (const GpuUnavailable& reason) {
                if (plan.longest_step == 0 || mesh.elements < least_refused) throw;
                results_.notes.push_back(
                    fmt::format("{} stops before {} elements: {}", name_of(engine), mesh.elements, reason.what()));
            }
            return true;
        });
        return mesh;
    }

    const BenchOptions& options_;
    ProgressLine& progress_;
    BenchResults results_;
    std::vector<BenchEngine> engines_;
    std::vector<PlannedStudy> studies_;
    imaging::Volume labels_;
    double all_work_ = 0, done_work_ = 0;
};

void write_results(const BenchResults& results, OutputFolder& output) {
    write_json(bench_json(results), output.path("bench.json"));
    write_file(bench_csv(results), output.path("bench.csv"));
    for (const StudyResults& study : results.studies)
        if (!study.meshes.empty()) write_file(bench_figure(study), output.path(name_of(study.study) + ".svg"));
    output.commit();
}

bool is_bench_output(const std::string& name) {
    if (name == "bench.json" || name == "bench.csv") return true;
    return name == "cube.svg" || name == "brain.svg" || name == "scaling.svg";
}

std::string fault_of(const EngineTiming& engine) {
    if (!engine.repeats_equal) return "runs from one state end in different bits";
    if (!std::isfinite(*engine.difference)) return "its displacements are not finite";
    return fmt::format("its displacements are {:.1e} of the largest from float64, more than {:.0e}", *engine.difference,
                       accepted_difference);
}

/// Throws SolverFailure for the first wrong result: its time means nothing.
void require_correct(const BenchResults& results) {
    for (const StudyResults& study : results.studies)
        for (const MeshTimings& mesh : study.meshes)
            for (const EngineTiming& engine : mesh.engines)
                if (!engine.correct())
                    throw SolverFailure(fmt::format(
                        "{} on the {} of {} elements is wrong: {}; its times mean nothing, try another --device",
                        name_of(engine.engine), name_of(study.study), mesh.elements, fault_of(engine)));
}

}  // namespace

void run_bench(const BenchOptions& options) {
    ProgressLine progress(options.common);
    if (options.study == "all" && !options.elements.empty())
        throw InvalidInput("--elements with --study all fits no study; name one: cube, brain or scaling");
    std::optional<OutputFolder> output;
    Benchmark benchmark(options, progress);
    if (!options.output.empty()) output.emplace(options.output, is_bench_output);
    const BenchResults results = benchmark.run();
    if (output) write_results(results, *output);
    require_correct(results);
}

}  // namespace tissuewarp::apps
