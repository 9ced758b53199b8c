#pragma once
/// Where the organ lies before the operation, when no label map says it.

#include "apps/inputs.hpp"

namespace tissuewarp::apps {

/// The file that says where the organ is: for messages.
const std::filesystem::path& organ_file(const PreoperativeOptions& options);

/// Fills `moving_labels`, and `moving_mesh` where one was given, from what else than a label map says where the organ
/// is, with a note of what was taken. Throws InvalidInput, naming the file and the remedy.
void find_organ(RegistrationInputs& inputs, const PreoperativeOptions& options);

}  // namespace tissuewarp::apps
