#pragma once
/// --resected auto.

#include "apps/progress.hpp"
#include "apps/register_run.hpp"

namespace tissuewarp::apps {

/// Finds what is gone and gives it a label of its own in the moving labels, which `options` then name as resected.
/// Labels that the fixed map lacks are gone; where there are none, a model of all tissue is registered first, and what
/// of it lies in a cavity of the fixed image is gone. Throws as registration::update.
void take_out_what_is_gone(RegistrationRun& run, RegisterOptions& options, double edge_length_mm,
                           ProgressLine& progress);

}  // namespace tissuewarp::apps
