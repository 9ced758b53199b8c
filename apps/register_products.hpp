#pragma once
/// From a deformation to fields, and to what they carry along.

#include "apps/progress.hpp"
#include "apps/register_run.hpp"

namespace tissuewarp::apps {

/// Also finds how the surroundings moved, where images show them.
void make_backward_field(RegistrationRun& run, ProgressLine& progress);
void make_forward_field(RegistrationRun& run, ProgressLine& progress);

/// Warps images, labels, points and the surface through the backward field and the deformation.
void warp_everything(RegistrationRun& run);

/// A hole in what was warped, and no place for points of what is gone.
void leave_out_what_is_gone(RegistrationRun& run, ProgressLine& progress);

/// Of what was warped; what is gone is no tissue that parted.
void find_parted(RegistrationRun& run);
void note_parted(const RegistrationRun& run, ProgressLine& progress);

}  // namespace tissuewarp::apps
