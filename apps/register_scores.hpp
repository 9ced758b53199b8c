#pragma once
/// How good a result is, and what speaks against it.

#include "apps/progress.hpp"
#include "apps/register_run.hpp"

#include <string>
#include <vector>

namespace tissuewarp::apps {

/// How far off the result may be, and what that says against it.
void estimate_errors(RegistrationRun& run, ProgressLine& progress);

/// How well labels agree, and points.
void score_warped(RegistrationRun& run);
/// The field that is written, everywhere and where the organ is.
void score_forward_field(RegistrationRun& run);

/// What the scores and what is gone say against the result.
void doubt_scores(RegistrationRun& run);

/// The codes of doubts in one line; "none" where there are none.
std::string codes(const std::vector<registration::Doubt>& doubts);
/// After everything was written. Throws SolverFailure.
void require_no_doubts(const RegistrationRun& run);

}  // namespace tissuewarp::apps
