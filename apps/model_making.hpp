#pragma once
/// The patient's model from what was read: for register and for prepare.

#include "apps/inputs.hpp"
#include "registration/prepare.hpp"

namespace tissuewarp::apps {

/// Of the mesh, mm: as asked for, or from the organ's volume and whether labels of the operation will be matched.
double chosen_edge_length(const PreoperativeOptions& options, const RegistrationInputs& inputs, bool for_labels);

/// Throws InvalidInput, Cancelled.
registration::PreparedModel made_model(const PreoperativeOptions& options, const RegistrationInputs& inputs,
                                       double edge_length_mm, Observer& observer);

/// The same with what updates take that look for loads (registration::prepare_loads).
registration::PreparedModel made_model_for_loads(const PreoperativeOptions& options, const RegistrationInputs& inputs,
                                                 double edge_length_mm, Observer& observer);

/// What matching images takes: that of --moving, and the contrasts.
void add_images(registration::PreparedModel& model, const RegistrationInputs& inputs, Observer& observer,
                const registration::ImageModelOptions& options = {});

}  // namespace tissuewarp::apps
