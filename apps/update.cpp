// tissuewarp update: a prepared patient to what is seen, with the results of register.

#include "apps/output_names.hpp"
#include "apps/patient_file.hpp"
#include "apps/register_dicom.hpp"
#include "apps/register_steps.hpp"
#include "apps/registration_checks.hpp"
#include "apps/verbs.hpp"
#include "apps/versions.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

namespace {

/// What register would have done otherwise.
void note_mesh(RegistrationInputs& inputs, const PreparedPatient& patient, const RegisterOptions& options) {
    const bool automatic = options.edge_length == 0 && options.moving_mesh.empty();
    if (options.fixed_labels.empty() || patient.for_labels || !automatic) return;
    inputs.notes.emplace_back(
        "the mesh was cut for data without labels, coarser than --fixed-labels make use of; prepare with --for-labels");
}

std::string mesh_plan(const registration::PreparedModel& model) {
    return fmt::format("take the {} tetrahedra of the patient", model.model.mesh.tet_count());
}

}  // namespace

void run_update(const UpdatePatientOptions& given) {
    StageClock clock;
    RegisterOptions options = given.registration;
    ProgressLine progress(options.common);
    RegistrationRun run(options, utc_now());

    progress.begin("reading the patient", 0.0, 0.1);
    PreparedPatient patient = read_patient_file(given.patient, progress);
    static_cast<PreoperativeOptions&>(options) = patient.options;
    options.parameters.insert(options.parameters.end(), patient.parameters.begin(), patient.parameters.end());
    complete_with_patient(options, given.patient);
    run.inputs = std::move(patient.inputs);
    run.prepared = std::move(patient.model);
    run.times.push_back(clock.lap("read the patient"));

    if (options.dry_run) require_could_write(options.output, is_register_output);
    if (!options.save_parameters.empty()) require_could_write_file(options.save_parameters);
    std::unique_ptr<OutputFolder> output;
    if (!options.dry_run) output = std::make_unique<OutputFolder>(options.output, is_register_output);

    progress.begin("reading", 0.1, 0.2);
    read_intraoperative(run.inputs, options, progress);
    require_inputs_stay(run.inputs, options.output);
    validate_intraoperative(run.inputs, options);
    note_mesh(run.inputs, patient, options);
    require_dicom_origins(options);
    run.times.push_back(clock.lap("read"));
    if (options.dry_run) {
        progress.clear();
        return print_plan(run.inputs, options, mesh_plan(*run.prepared));
    }
    register_and_write(run, *output, clock, progress);
}

}  // namespace tissuewarp::apps
