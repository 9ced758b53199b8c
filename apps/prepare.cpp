// tissuewarp prepare: the patient's model before the operation, in one file for update and serve.

#include "apps/model_making.hpp"
#include "apps/output_folder.hpp"
#include "apps/patient_file.hpp"
#include "apps/progress.hpp"
#include "apps/register_run.hpp"
#include "apps/verbs.hpp"
#include "apps/versions.hpp"
#include "core/errors.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

namespace {

void require_place(const std::filesystem::path& output) {
    if (output.extension() != ".tw")
        throw InvalidInput(fmt::format("--output '{}' is no name of a patient file; end it in .tw", output.string()));
    require_could_write_file(output);
}

void print_summary(const PrepareModelOptions& options, const RegistrationInputs& inputs,
                   const registration::PreparedModel& model, double seconds) {
    fmt::print("prepared {} tetrahedra, {} in {:.1f} s: '{}'\n", model.model.mesh.tet_count(),
               model.image ? fmt::format("an image and {} contrasts", model.contrasts.size()) : "no image", seconds,
               options.output.string());
    for (const std::string& note : inputs.notes) fmt::print("note: {}\n", note);
}

}  // namespace

void run_prepare(const PrepareModelOptions& options) {
    StageClock clock;
    const std::string started = utc_now();
    const PreoperativeOptions& preoperative = options.preoperative;
    ProgressLine progress(options.common);
    require_place(options.output);
    progress.begin("reading", 0.0, 0.1);
    RegistrationInputs inputs = read_preoperative(preoperative, progress);
    validate_preoperative(inputs, preoperative, options.resample_labels);
    progress.begin("preparing the model", 0.1, 0.9);
    registration::PreparedModel model = made_model_for_loads(
        preoperative, inputs, chosen_edge_length(preoperative, inputs, options.for_labels), progress);
    if (!inputs.moving.empty()) add_images(model, inputs, progress);
    progress.begin("writing", 0.9, 1.0);
    write_patient_file(options, inputs, model, started);
    progress.clear();
    inputs.notes.insert(inputs.notes.end(), progress.notes().begin(), progress.notes().end());
    if (!options.common.quiet) print_summary(options, inputs, model, clock.total());
}

}  // namespace tissuewarp::apps
