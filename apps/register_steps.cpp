#include "apps/register_steps.hpp"

#include "apps/bids.hpp"
#include "apps/dial.hpp"
#include "apps/finished_tasks.hpp"
#include "apps/module_description.hpp"
#include "apps/output_names.hpp"
#include "apps/register_outputs.hpp"
#include "apps/register_products.hpp"
#include "apps/register_scores.hpp"
#include "apps/register_summary.hpp"
#include "apps/report_json.hpp"
#include "apps/silenced_stderr.hpp"
#include "apps/update_device.hpp"
#include "apps/versions.hpp"
#include "core/errors.hpp"
#include "imaging/labels.hpp"
#include "registration/stretch/stretched_update.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <tbb/task_arena.h>

namespace tissuewarp::apps {

using namespace registration;

namespace {

UpdateOptions update_options(const RegistrationRun& run) {
    const RegisterOptions& options = run.options;
    UpdateOptions result = on_device(options.device);
    result.align = !options.no_align;
    result.rematches = options.rounds;
    if (options.similarity == "self-similarity") result.image.similarity = Similarity::SelfSimilarity;
    if (options.similarity == "linear-combination") result.image.similarity = Similarity::LinearCombination;
    result.equilibrium.tolerance_mm = options.tolerance;
    expect_motion_of(tissue_named(options.tissue), result);
    if (run.dial) result.time_budget_s = run.dial->update_budget_s;
    return result;
}

void register_to(RegistrationRun& run, const Intraoperative& seen, Observer& observer) {
    const Tissue& tissue = tissue_named(run.options.tissue);
    if (stretches_freely(*run.prepared, seen, tissue)) {
        run.stretched = update_stretched(*run.prepared, seen, tissue, update_options(run), observer);
        run.result = run.stretched->result;
        return;
    }
    if (tissue.free_stretch > 0)
        observer.note(
            "the organ is not stretched as a whole before its tissue is strained: that takes fixed labels and "
            "nothing else, without anchors, rigid neighbours and resected tissue");
    run.result = update(*run.prepared, seen, update_options(run), observer);
}

Intraoperative seen(const RegistrationInputs& inputs, const RegisterOptions& options) {
    Intraoperative seen{.surface = inputs.fixed_surface, .points = inputs.point_pairs, .curves = inputs.curves};
    if (inputs.start) seen.start = inputs.start->placement;
    if (options.match_image) {
        seen.image = inputs.fixed_matched;
        seen.contrasts = inputs.fixed_contrasts;
    }
    // An image that is only the grid of the output must not coarsen the boundary that is matched.
    if (!inputs.fixed_labels.empty())
        seen.labels = options.match_image ? inputs.fixed_labels : inputs.fixed_labels_as_given;
    return seen;
}

}  // namespace

void print_plan(const RegistrationInputs& inputs, const RegisterOptions& options, const std::string& mesh) {
    const auto grid = [](const imaging::Geometry& g) {
        return fmt::format("{} x {} x {} voxels of {:g} x {:g} x {:g} mm", g.size[0], g.size[1], g.size[2],
                           g.spacing[0], g.spacing[1], g.spacing[2]);
    };
    const imaging::Geometry* fixed = inputs.fixed_grid();
    fmt::print("moving grid   {}\nfixed grid    {}\nlabels        {}\n", grid(inputs.moving_grid()),
               fixed ? grid(*fixed) : "the moving one, carried along by the rigid alignment",
               fmt::join(imaging::labels_in(inputs.moving_labels), ", "));
    if (!options.anchors.empty()) fmt::print("stay          {}\n", fmt::join(options.anchors, ", "));
    if (!options.rigid_neighbours.empty()) fmt::print("rigid         {}\n", fmt::join(options.rigid_neighbours, ", "));
    if (options.find_resected) fmt::print("gone          sought in what was seen\n");
    if (!options.resected.empty()) fmt::print("gone          {}\n", fmt::join(options.resected, ", "));
    fmt::print("would {}, {}, match in {} rounds on device '{}', and write to '{}':\n", mesh,
               options.no_align ? "not align" : "align rigidly", options.rounds, options.device.name,
               options.output.string());
    for (const std::string& name : output_names(options)) fmt::print("  {}\n", name);
    for (const std::string& note : inputs.notes) fmt::print("note: {}\n", note);
}

/// Results of an older run go when the new ones come: an input must not be one of them.
void require_inputs_stay(const RegistrationInputs& inputs, const std::filesystem::path& output) {
    for (const InputFile& file : inputs.files) {
        std::error_code none;
        const bool within =
            std::filesystem::equivalent(std::filesystem::absolute(file.path).parent_path(), output, none);
        if (!none && within && is_register_output(file.path.filename().string()))
            throw InvalidInput(
                fmt::format("--{} '{}' is a result in the output folder, which this run would replace; "
                            "choose another --output",
                            file.role, file.path.string()));
    }
}

UpdateResult first_update(const RegistrationRun& run, const PreparedModel& model, Observer& observer) {
    return update(model, seen(run.inputs, run.options), for_first_look(update_options(run)), observer);
}

void append(std::vector<StageTime>& times, const std::vector<StageTime>& more) {
    times.insert(times.end(), more.begin(), more.end());
}

void register_and_write(RegistrationRun& run, OutputFolder& output, StageClock& clock, ProgressLine& progress) {
    const RegisterOptions& options = run.options;
    progress.begin("registering", 0.20, 0.47);
    const double ready = clock.total();
    register_to(run, seen(run.inputs, options), progress);
    append(run.times, run.result.times);
    clock.lap("");

    make_backward_field(run, progress);
    run.times.push_back(clock.lap("fields"));
    warp_everything(run);
    leave_out_what_is_gone(run, progress);
    run.times.push_back(clock.lap("warp"));
    run.intraoperative_seconds = clock.total() - ready;

    progress.begin("error estimate", 0.55, 0.85);
    // All that waits for nothing else runs at once, compression of files beside factors of the estimate; but what takes
    // memory and is not needed yet waits until these are gone. A stage's time is that until it was there.
    auto silenced = std::make_unique<SilencedStandardError>();
    FinishedTasks written, warped_scored, forward_scored;  // groups of their own: what fails ends its group
    tbb::task_group& writing = written.group;
    if (writes(options, inverse_transform)) make_forward_field(run, progress);
    start_writing_warped(run, output, writing);
    if (!options.no_error_estimate) {
        malloc_trim(0);  // before factors: what meshing and matching left in pieces goes back to the system
        // Isolated, so that waiting for its parts does not begin the rest.
        tbb::this_task_arena::isolate([&] { estimate_errors(run, progress); });
        run.times.push_back(clock.lap("error estimate"));
    }
    progress.begin("writing and scoring", 0.85, 0.97);
    warped_scored.group.run([&] {
        score_warped(run);
        find_parted(run);
    });
    if (run.products.moving_to_fixed.empty()) make_forward_field(run, progress);
    start_writing_forward(run, output, writing);
    forward_scored.group.run([&] { score_forward_field(run); });
    const report::Pictures pictures = draw_pictures(run);
    run.times.push_back(clock.lap("pictures"));
    warped_scored.group.wait();
    forward_scored.group.wait();
    run.times.push_back(clock.lap("score"));
    if (run.dial) doubt_dial(run);
    doubt_scores(run);
    for (Doubt& doubt : run.result.doubts) doubt.text = imaging::with_label_names(doubt.text, run.inputs.label_names);
    start_writing_estimates(run, output, writing);
    writing.wait();
    silenced.reset();
    note_parted(run, progress);
    run.times.push_back(clock.lap("write"));

    progress.begin("report", 0.97, 1.0);
    run.notes = progress.notes();
    const nlohmann::json report = report_json(run, clock.total());
    write_reports(report, pictures, output);
    output.commit();
    if (!options.bids.empty()) write_bids_dataset(options);
    if (!options.save_parameters.empty()) save_parameters(options.parameters, options.save_parameters);
    run.times.push_back(clock.lap("report"));
    write_return_parameters(options.common.return_parameters, {{"doubts", codes(run.result.doubts)}});
    progress.clear();
    if (!options.common.quiet) fmt::print("{}", summary_text(run, clock.total()));
    if (options.strict) require_no_doubts(run);
}

}  // namespace tissuewarp::apps
