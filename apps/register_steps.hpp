#pragma once
/// What register and update have in common: from a model and what was seen to the files.

#include "apps/output_folder.hpp"
#include "apps/progress.hpp"
#include "apps/register_run.hpp"

namespace tissuewarp::apps {

/// What --dry-run prints; `mesh` says what would be done about one.
void print_plan(const RegistrationInputs& inputs, const RegisterOptions& options, const std::string& mesh);

/// Results of an older run go when the new ones come: an input must not be one of them. Throws InvalidInput.
void require_inputs_stay(const RegistrationInputs& inputs, const std::filesystem::path& output);

/// Registers run.prepared to what run.inputs hold, judges the result and writes it. Throws what the verbs throw.
void register_and_write(RegistrationRun& run, OutputFolder& output, StageClock& clock, ProgressLine& progress);

/// A first look at all that was seen (FirstLook), with a model of all tissue.
registration::UpdateResult first_update(const RegistrationRun& run, const registration::PreparedModel& model,
                                        Observer& observer);

void append(std::vector<registration::StageTime>& times, const std::vector<registration::StageTime>& more);

}  // namespace tissuewarp::apps
