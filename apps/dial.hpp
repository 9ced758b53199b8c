#pragma once
/// --accuracy and --time-budget of `register`.

#include "apps/register_run.hpp"

namespace tissuewarp::apps {

/// What the fronts of this machine say of the inputs. Throws InvalidInput for requests that contradict other options.
registration::DialChoice dial_choice(const RegistrationInputs& inputs, const RegisterOptions& options);

/// Adds to the doubts of the result where it took longer or is estimated worse than was asked for.
void doubt_dial(RegistrationRun& run);

}  // namespace tissuewarp::apps
