// tissuewarp explain: what a scene will run, without running it.

#include "apps/naming_page.hpp"
#include "apps/progress.hpp"
#include "apps/scene_file.hpp"
#include "apps/verbs.hpp"
#include "simulation/loads.hpp"
#include "simulation/plan.hpp"
#include "simulation/run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <string>

namespace tissuewarp::apps {

namespace {

std::string work_text(const simulation::Work& work) {
    return fmt::format("{:>10.3f} MB {:>10.3f} Mflop", 1e-6 * work.bytes, 1e-6 * work.flops);
}

std::string absent_effects(const std::vector<simulation::PlannedEffect>& present) {
    std::string text;
    for (const char* name : {"fixed", "motion", "springs", "gravity", "viscosity", "fluid", "pressure", "traction",
                             "membrane", "sliding", "parting", "contact"})
        if (std::none_of(present.begin(), present.end(), [&](const auto& effect) { return effect.name == name; }))
            text += (text.empty() ? "" : ", ") + std::string(name);
    return text;
}

/// "node.fluid, node.contact": chunks without folder and ending, less those that every program has.
std::string parts_text(const tled::StepPass& pass) {
    std::string text;
    for (const std::string& file : pass.parts) {
        const std::string part = std::filesystem::path(file).stem().string();
        if (part == "index" || part == "bindings" || part == "numbers") continue;
        text += (text.empty() ? "" : ", ") + part;
    }
    return text;
}

/// The programs and buffers of a step under the loads of the scene's end.
void print_passes(const simulation::BuiltScene& built, Observer& observer) {
    const simulation::Solve& solve = built.scene.solve;
    const simulation::Stage& stage = built.stages.back();
    const auto engine = simulation::engine_for(solve, stage.rest, observer);
    simulation::LoadsInTime loads(built, stage, solve.duration);
    engine->set_conditions(loads.at(solve.duration));
    fmt::print("\na step on {}\n", engine->description());
    std::map<std::string, std::size_t> buffers;
    for (const tled::StepPass& pass : engine->step_passes()) {
        fmt::print("  {:<34}{:>10}  {}\n", std::filesystem::path(pass.program).filename().string(), pass.invocations,
                   parts_text(pass));
        for (const tled::StepBuffer& buffer : pass.buffers) buffers[buffer.name] = buffer.bytes;
    }
    fmt::print("  buffers:");
    for (const auto& [name, bytes] : buffers) fmt::print(" {} {:.1f} kB;", name, 1e-3 * static_cast<double>(bytes));
    fmt::print("\n");
}

}  // namespace

void run_explain(const ExplainOptions& options) {
    ProgressLine progress(options.common);
    progress.begin("reading", 0.0, 0.05);
    const simulation::Scene scene = naming_page(scenes_page, [&] { return read_scene(options.scene, progress); });
    progress.begin("building", 0.05, 1.0);
    const simulation::BuiltScene built = simulation::build(scene, progress);
    const simulation::Plan plan = simulation::plan_of(built);
    progress.clear();
    const bool dynamics = scene.solve.kind == simulation::Solve::Kind::Dynamics;
    fmt::print("{}: {} over {:g} s, {} frames\n", scene.title, dynamics ? "dynamics" : "equilibria",
               scene.solve.duration, scene.solve.frames);
    fmt::print("{} nodes, {} {}, {} faces outside, {} stage(s)\n", plan.nodes, plan.tetrahedra, plan.element,
               plan.outer_faces, built.stages.size());
    for (const std::string& law : plan.laws) fmt::print("  {}\n", law);
    fmt::print("\n{:<44}{}\n", "a step, counted", "   memory traffic   arithmetic");
    fmt::print("{:<44}{}\n", "elements and nodes on the CPU", work_text(plan.cpu));
    fmt::print("{:<44}{}\n", "elements and nodes on a GPU", work_text(plan.gpu));
    for (const simulation::PlannedEffect& effect : plan.effects)
        fmt::print("{:<44}{}\n", "  + " + effect.name + ", " + effect.detail,
                   effect.work.bytes > 0 ? work_text(effect.work) : "          within the above");
    fmt::print("absent, and costing nothing: {}\n", absent_effects(plan.effects));
    fmt::print("\narrays of a float32 engine: {:.1f} MB\n", 1e-6 * plan.memory);
    if (dynamics)
        fmt::print("time step of at least {:.1f} us: at most {:.0f} steps\n", 1e6 * plan.time_step,
                   scene.solve.duration / plan.time_step);
    print_passes(built, progress);
    for (const std::string& note : progress.notes()) fmt::print("note: {}\n", note);
}

}  // namespace tissuewarp::apps
