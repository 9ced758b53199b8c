#include "apps/register_steps.hpp"

#include "apps/bids.hpp"
#include "apps/dial.hpp"
#include "apps/finished_tasks.hpp"
#include "apps/module_description.hpp"
#include "apps/output_names.hpp"
#include "apps/register_outputs.hpp"
#include "apps/report_json.hpp"
#include "apps/silenced_stderr.hpp"
#include "apps/update_device.hpp"
#include "apps/versions.hpp"
#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/labels.hpp"
#include "registration/evaluation/curve_residual.hpp"
#include "registration/field.hpp"
#include "registration/field/parted.hpp"
#include "registration/io/curves.hpp"
#include "registration/resection/gap.hpp"
#include "registration/stretch/stretched_update.hpp"
#include "registration/surroundings/rigid_surroundings.hpp"
#include "registration/warp.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <limits>

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

/// Coordinates that are not a number where the tissue of a point is gone.
void mark_gone(const RegistrationRun& run, const Eigen::Matrix3Xd& places, Eigen::Matrix3Xd& carried) {
    const std::vector<bool> gone = points_gone(run.result.deformation, run.prepared->resected, places);
    for (Eigen::Index p = 0; p < carried.cols(); ++p)
        if (gone[static_cast<std::size_t>(p)]) carried.col(p).setConstant(std::numeric_limits<double>::quiet_NaN());
}

void note_points_gone(const Eigen::Matrix3Xd& carried, const char* what, ProgressLine& progress) {
    const Eigen::Index left = carried.array().isFinite().colwise().all().count();
    if (left == carried.cols()) return;
    progress.note(fmt::format("{} of {} {} lay in resected tissue: they have no place and are not scored",
                              carried.cols() - left, carried.cols(), what));
}

/// A hole in what was warped, and no place for points of what is gone.
void leave_out_what_is_gone(RegistrationRun& run, ProgressLine& progress) {
    const imaging::Volume& resected = run.prepared->resected;
    Products& products = run.products;
    if (run.options.find_resected) products.gap = imaging::Volume(products.fixed_to_moving.geometry, CV_8UC1);
    if (resected.empty()) return;
    products.gap = gap_after(run.result.deformation, resected, products.fixed_to_moving);
    if (!products.warped.empty()) leave_gap(products.warped, products.gap, gap_value);
    leave_gap(products.warped_labels, products.gap);
    if (run.inputs.landmarks) mark_gone(run, run.inputs.landmarks->moving, products.landmarks);
    if (run.inputs.points) mark_gone(run, *run.inputs.points, products.points);
    note_points_gone(products.landmarks, "landmarks", progress);
    note_points_gone(products.points, "points", progress);
}

/// Where no fixed image gives a grid: the moving one, carried along by the rigid alignment.
imaging::Geometry output_grid(const RegistrationRun& run) {
    if (const imaging::Geometry* fixed = run.inputs.fixed_grid()) return *fixed;
    const Eigen::Isometry3d& placement = run.result.deformation.placement;
    imaging::Geometry grid = run.inputs.moving_grid();
    grid.origin = placement * grid.origin;
    grid.direction = placement.linear() * grid.direction;
    return grid;
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

void make_backward_field(RegistrationRun& run, ProgressLine& progress) {
    progress.begin("field", 0.47, 0.55);
    const FieldOptions options{run.options.fade};
    Deformation& deformation = run.result.deformation;
    if (!run.inputs.moving.empty() && !run.inputs.fixed.empty())
        deformation.surroundings =
            rigid_surroundings(deformation, run.inputs.moving, run.inputs.fixed, options, progress);
    run.products.fixed_to_moving = displacement_fixed_to_moving(deformation, output_grid(run), options, progress);
    run.products.unfolded_back = unfold_fixed_to_moving(run.products.fixed_to_moving, deformation);
}

void make_forward_field(RegistrationRun& run, ProgressLine& progress) {
    run.products.moving_to_fixed = displacement_moving_to_fixed(run.result.deformation, run.inputs.moving_grid(),
                                                                FieldOptions{run.options.fade}, progress);
    run.products.unfolded_forth = unfold_moving_to_fixed(run.products.moving_to_fixed, run.result.deformation);
}

void warp_everything(RegistrationRun& run) {
    const RegistrationInputs& inputs = run.inputs;
    Products& products = run.products;
    if (!inputs.moving.empty()) products.warped = warp_image(inputs.moving, products.fixed_to_moving);
    products.warped_labels = warp_labels(inputs.moving_labels, products.fixed_to_moving);
    if (!inputs.landmarks && !inputs.points && !inputs.surface) return;
    const PointTransform transform(run.result.deformation, {run.options.fade});
    if (inputs.landmarks) products.landmarks = transform(inputs.landmarks->moving);
    if (inputs.points) products.points = transform(*inputs.points);
    if (inputs.surface) {
        products.surface = inputs.surface;
        products.surface->nodes = transform(products.surface->nodes);
    }
}

/// How far off the result may be, and what that says against it.
void estimate_errors(RegistrationRun& run, ProgressLine& progress) {
    Products& products = run.products;
    products.uncertainty = run.stretched ? uncertainty(*run.stretched, {}, progress)
                                         : uncertainty(*run.prepared, run.result, {}, progress);
    products.uncertainty_volumes =
        uncertainty_on_grid(*products.uncertainty, run.result.deformation, products.fixed_to_moving.geometry);
    for (Doubt& doubt : doubts_of(*products.uncertainty, run.options.tolerance))
        run.result.doubts.push_back(std::move(doubt));
}

CurveDistances curve_distances(const RegistrationRun& run) {
    constexpr double step_mm = 1;  // tissue bends what is between two points of a file
    const Curves& curves = *run.inputs.curves;
    const PointTransform transform(run.result.deformation, {run.options.fade});
    std::vector<Eigen::Matrix3Xd> carried;
    for (const Eigen::Matrix3Xd& line : curves.moving) carried.push_back(transform(evenly_along(line, step_mm)));
    return {curve_residual(curves.moving, curves.fixed, {}).to_lines,
            curve_residual(carried, curves.fixed, {}).to_lines};
}

/// After everything was written. Throws SolverFailure.
void require_no_doubts(const RegistrationRun& run) {
    std::vector<std::string> codes;
    for (const Doubt& doubt : run.result.doubts)
        if (doubt.severity == Severity::Doubt) codes.push_back(doubt.code);
    if (codes.empty()) return;
    throw SolverFailure(fmt::format(
        "the result is doubted ({}); '{}' says why, docs/manual/doubts.md what it means; all files are written",
        fmt::join(codes, ", "), (run.options.output / "report.json").string()));
}

/// What is gone is no tissue that parted.
void find_parted(RegistrationRun& run) {
    Products& products = run.products;
    if (!writes_gap(run.options)) return;
    products.parted = parted_after(run.result.deformation, products.fixed_to_moving);
    if (!products.gap.empty()) products.parted.voxels.setTo(0, products.gap.voxels);
}

void note_parted(const RegistrationRun& run, ProgressLine& progress) {
    constexpr double least_ml = 0.1;
    const double ml = imaging::millilitres(run.products.parted);
    if (ml < least_ml) return;
    progress.note(
        fmt::format("tissue parted: {:.1f} ml of what was warped show what lay there before stretched to more "
                    "than twice its volume ({} is 2 there)",
                    ml, gap_name));
}

/// How well labels agree, and points.
void score_warped(RegistrationRun& run) {
    Scores& scores = run.scores;
    const auto organ = [&](const imaging::Volume& labels) { return organ_of(labels, run.options); };
    if (!run.inputs.fixed_labels.empty()) {
        const imaging::Volume fixed = organ(run.inputs.fixed_labels);
        tbb::parallel_invoke(
            [&] {
                const imaging::Volume moving = organ(run.inputs.moving_labels);
                scores.before =
                    overlap(imaging::resample(moving, fixed.geometry, imaging::Interpolation::Nearest), fixed);
            },
            [&] { scores.after = overlap(organ(run.products.warped_labels), fixed); });
    }
    scores.mesh = mesh_jacobians(run.result.deformation);
    if (run.inputs.landmarks) scores.target_error = target_error(*run.inputs.landmarks, run.products.landmarks);
    if (run.inputs.curves) scores.curves = curve_distances(run);
}

/// The field that is written, everywhere and where the organ is.
void score_forward_field(RegistrationRun& run) {
    const imaging::Volume organ = imaging::mask_of_all(organ_of(run.inputs.moving_labels, run.options));
    run.scores.organ = field_jacobians(run.products.moving_to_fixed, &organ);
    run.scores.grid = field_jacobians(run.products.moving_to_fixed);
}

/// What the scores and what is gone say against the result.
void doubt_scores(RegistrationRun& run) {
    std::vector<Doubt>& doubts = run.result.doubts;
    if (auto doubt = doubt_of_folds(run.scores.grid, run.scores.organ, run.products.unfolded_back))
        doubts.push_back(std::move(*doubt));
    if (auto doubt = doubt_of_unfolding(run.products.unfolded_forth, run.products.unfolded_back))
        doubts.push_back(std::move(*doubt));
    if (!run.products.gap.empty() && !run.inputs.fixed_labels.empty())
        if (auto doubt = doubt_of_gap(run.products.gap, run.inputs.fixed_labels)) doubts.push_back(std::move(*doubt));
    if (!run.resection) return;
    for (Doubt& doubt : doubts_of(*run.resection, run.products.gap)) doubts.push_back(std::move(doubt));
}

/// The codes of doubts in one line; "none" where there are none.
std::string codes(const std::vector<Doubt>& doubts) {
    std::vector<std::string> result;
    for (const Doubt& doubt : doubts) result.push_back(doubt.code);
    return result.empty() ? "none" : fmt::format("{}", fmt::join(result, ", "));
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
