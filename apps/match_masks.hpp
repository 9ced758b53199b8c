#pragma once
/// Masks over the images that are matched.

#include "apps/inputs.hpp"

namespace tissuewarp::apps {

/// Reads --moving-mask and --fixed-mask and fills `moving_matched` and `fixed_matched`, with a note of how much each
/// excludes. Throws IoError or InvalidInput, naming the file.
void exclude_unmatched(RegistrationInputs& inputs, const RegisterOptions& options);

}  // namespace tissuewarp::apps
