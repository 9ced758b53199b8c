#pragma once
/// Where the organ lies before anything is matched, told by a file.

#include "apps/inputs.hpp"

namespace tissuewarp::apps {

/// Reads --initial-transform and fills `start`, with notes: how much of it is not rigid, and how near it brings the
/// organ to what was seen, which tells whether it maps the right way. Throws IoError or InvalidInput, naming the file.
void take_initial_transform(RegistrationInputs& inputs, const IntraoperativeOptions& options);

}  // namespace tissuewarp::apps
