// tissuewarp register: from files to the model, and on by what update takes too.

#include "apps/dial.hpp"
#include "apps/model_making.hpp"
#include "apps/output_names.hpp"
#include "apps/register_dicom.hpp"
#include "apps/register_steps.hpp"
#include "apps/resection_search.hpp"
#include "apps/verbs.hpp"
#include "apps/versions.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

namespace {

/// Labels, and points of an organ that may lie anywhere, also tell loads that nobody stated.
bool looks_for_loads(const RegisterOptions& options) {
    return !options.match_image && (!options.fixed_labels.empty() || !options.no_align);
}

double edge_length(const RegistrationRun& run) {
    if (run.dial && !run.inputs.moving_mesh) return run.dial->edge_length_mm;
    return chosen_edge_length(run.options, run.inputs, !run.inputs.fixed_labels.empty());
}

std::string mesh_plan(const RegistrationRun& run) {
    if (run.inputs.moving_mesh)
        return fmt::format("take {} tetrahedra as they are", run.inputs.moving_mesh->tet_count());
    return fmt::format("mesh with edges of {:.3g} mm", edge_length(run));
}

}  // namespace

void run_register(const RegisterOptions& given) {
    RegisterOptions options = given;  // what is gone may be found
    StageClock clock;
    ProgressLine progress(options.common);
    RegistrationRun run(options, utc_now());

    if (options.dry_run) require_could_write(options.output, is_register_output);
    if (!options.save_parameters.empty()) require_could_write_file(options.save_parameters);
    std::unique_ptr<OutputFolder> output;
    if (!options.dry_run) output = std::make_unique<OutputFolder>(options.output, is_register_output);

    progress.begin("reading", 0.0, 0.02);
    run.inputs = read_inputs(options, progress);
    require_inputs_stay(run.inputs, options.output);
    validate_preoperative(run.inputs, options, options.resample_labels);
    validate_intraoperative(run.inputs, options);
    require_dicom_origins(options);
    run.times.push_back(clock.lap("read"));
    if (options.dry_run) {
        progress.clear();
        return print_plan(run.inputs, options, mesh_plan(run));
    }

    if (options.accuracy || options.time_budget) {
        run.dial = dial_choice(run.inputs, options);
        progress.note(run.dial->reason);
    }
    if (options.find_resected) {
        progress.begin("looking for what is gone", 0.02, 0.10);
        take_out_what_is_gone(run, options, edge_length(run), progress);
        run.times.push_back(clock.lap("resection"));
    }
    progress.begin("preparing the model", options.find_resected ? 0.10 : 0.02, 0.20);
    const auto make = looks_for_loads(options) ? made_model_for_loads : made_model;
    run.prepared = std::make_unique<registration::PreparedModel>(make(options, run.inputs, edge_length(run), progress));
    if (options.match_image) add_images(*run.prepared, run.inputs, progress);
    append(run.times, run.prepared->times);
    register_and_write(run, *output, clock, progress);
}

}  // namespace tissuewarp::apps
