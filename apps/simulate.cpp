// tissuewarp simulate: what a scene file says, from its mesh to its frames.

#include "apps/ablate.hpp"
#include "apps/module_description.hpp"
#include "apps/naming_page.hpp"
#include "apps/output_folder.hpp"
#include "apps/progress.hpp"
#include "apps/report_json.hpp"
#include "apps/scene_file.hpp"
#include "apps/scene_templates.hpp"
#include "apps/verbs.hpp"
#include "apps/versions.hpp"
#include "core/atomic_file.hpp"
#include "core/sha256.hpp"
#include "simulation/limits.hpp"
#include "simulation/series_io.hpp"

#include <fmt/format.h>

#include <chrono>
#include <set>

namespace tissuewarp::apps {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

json summary_json(const SimulateOptions& options, const simulation::BuiltScene& built,
                  const simulation::RunSummary& run, const std::vector<std::string>& notes, double building) {
    const simulation::Scene& scene = built.scene;
    const tled::RestState& simulated = built.stages.front().rest;
    json summary = {{"schema", "tissuewarp.simulation"},
                    {"schema_version", 1},
                    {"version", program_version()},
                    {"title", scene.title},
                    {"scene", {{"file", options.scene.string()}, {"sha256", sha256_of_file(options.scene)}}},
                    {"kind", scene.solve.kind == simulation::Solve::Kind::Dynamics ? "dynamics" : "equilibrium"},
                    {"nodes", simulated.node_count},
                    {"tetrahedra", simulated.element_count()},
                    {"frames", run.frames},
                    {"largest_displacement_mm", run.largest_displacement},
                    {"min_jacobian", run.min_jacobian},
                    {"estimated_error_mm", run.estimated_error_mm},
                    {"force_evaluations", run.steps},
                    {"time_step_s", run.time_step},
                    {"engine", run.engine},
                    {"seconds", {{"building", building}, {"solving", run.seconds}}},
                    {"notes", notes}};
    return summary;
}

void print_summary(const simulation::BuiltScene& built, const simulation::RunSummary& run, const fs::path& folder) {
    const tled::RestState& simulated = built.stages.front().rest;
    fmt::print("{} nodes, {} tetrahedra, {}\n", simulated.node_count, simulated.element_count(), run.engine);
    fmt::print("{} frames in {:.2f} s, {} force evaluations; largest displacement {:.3f} mm, least det F {:.3f}\n",
               run.frames, run.seconds, run.steps, run.largest_displacement, run.min_jacobian);
    if (run.estimated_error_mm > 0) fmt::print("estimated error {:.4f} mm\n", run.estimated_error_mm);
    fmt::print("{}\n", (folder / "frames.pvd").string());
}

void apply_device(const DeviceChoice& device, simulation::Solve& solve) {
    if (device.name == "auto") return;
    solve.device = device.name == "cpu" ? simulation::Device::Cpu : simulation::Device::Gpu;
    if (device.name.starts_with("gpu:")) solve.gpu_index = std::stoi(device.name.substr(4));
}

bool is_simulate_output(const std::string& name) {
    static const std::set<std::string> names{"summary.json", "frames.pvd", "frames.xdmf", "displacement.h5",
                                             "probes.csv"};
    return names.contains(name) || (name.starts_with("frame_") && name.ends_with(".vtu"));
}

/// --init: a scene to begin with.
void write_template(const SimulateOptions& options) {
    const fs::path file = options.scene.empty() ? fs::path(options.init + ".toml") : options.scene;
    fs::path labels = file;
    labels.replace_extension(".labels.nii.gz");
    const SceneTemplate scene = scene_template(options.init, labels.filename().string());
    const auto require_new = [](const fs::path& path) {
        std::error_code failure;
        if (fs::exists(path, failure))
            throw InvalidInput("'" + path.string() + "' is there already; give another name");
    };
    require_new(file);
    if (!scene.labels.empty()) {
        require_new(labels);
        write_file(scene.labels, labels);
    }
    write_file(scene.text, file);
    if (!options.common.quiet)
        fmt::print("{0}; run it with\n    tissuewarp simulate {0} --output {1}\n", file.string(), options.init);
}

void run_ablation(const SimulateOptions& options) {
    ProgressLine progress(options.common);
    progress.begin("reading", 0.0, 0.02);
    simulation::Scene scene = naming_page(scenes_page, [&] { return read_scene(options.scene, progress); });
    apply_device(options.device, scene.solve);
    simulation::require_supported(scene);
    progress.begin("simulating", 0.02, 1.0);
    const simulation::Ablation ablation = simulation::ablate(scene, progress);
    progress.clear();
    print_ablation(ablation, !scene.probes.empty());
    for (const std::string& note : progress.notes()) fmt::print("note: {}\n", note);
}

}  // namespace

void run_simulate(const SimulateOptions& options) {
    if (!options.init.empty()) return write_template(options);
    if (options.scene.empty()) throw InvalidInput("give a scene file, or --init to write one");
    if (options.ablate) return run_ablation(options);
    ProgressLine progress(options.common);
    if (options.output.empty()) throw InvalidInput("give --output, the folder for the frames");
    require_could_write(options.output, is_simulate_output);
    progress.begin("reading", 0.0, 0.02);
    simulation::Scene scene = naming_page(scenes_page, [&] { return read_scene(options.scene, progress); });
    apply_device(options.device, scene.solve);
    simulation::require_supported(scene);
    progress.begin("building", 0.02, 0.3);
    const auto start = std::chrono::steady_clock::now();
    const simulation::BuiltScene built = simulation::build(scene, progress);
    const double building = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

    OutputFolder folder(options.output, is_simulate_output);
    progress.begin("simulating", 0.3, 1.0);
    simulation::SeriesWriter series(built, folder.staging());
    const simulation::RunSummary run = simulation::simulate(
        built, [&](const simulation::Frame& frame) { series.add(frame); }, progress);
    series.finish();
    write_json(summary_json(options, built, run, progress.notes(), building), folder.path("summary.json"));
    folder.commit();
    write_return_parameters(options.common.return_parameters, {});
    progress.clear();
    if (options.common.quiet) return;
    for (const std::string& note : progress.notes()) fmt::print("note: {}\n", note);
    print_summary(built, run, options.output);
}

}  // namespace tissuewarp::apps
