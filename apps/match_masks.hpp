#pragma once
/// Masks over the images that are matched.

#include "apps/inputs.hpp"

namespace tissuewarp::apps {

/// Read --moving-mask and fill `moving_matched`, and --fixed-mask and `fixed_matched`, with a note of how much each
/// excludes. Throw IoError or InvalidInput, naming the file.
void exclude_unmatched_moving(RegistrationInputs& inputs, const PreoperativeOptions& options);
void exclude_unmatched_fixed(RegistrationInputs& inputs, const IntraoperativeOptions& options);

}  // namespace tissuewarp::apps
