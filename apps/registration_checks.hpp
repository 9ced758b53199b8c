#pragma once
/// What the options of a registration must agree on. Each throws InvalidInput with what is missing and the remedy.

#include "apps/options.hpp"

namespace tissuewarp::apps {

/// Something must be registered to; the fixed image is, where it is all there is.
void require_data(IntraoperativeOptions& o);
/// Something must say where the organ is, and what the numbers of other options mean.
void require_organ(const PreoperativeOptions& o);
/// `option` speaks of labels.
void refuse_without_labels(const PreoperativeOptions& o, const char* option);
/// What is gone is sought in an image or labels, and the model is then meshed without it.
void require_where_to_find_resection(const RegisterOptions& o);
/// Contrasts are matched pair by pair, and only where images are matched.
void require_pairs(const RegisterOptions& o);
void require_contrasts_matched(const RegisterOptions& o);
/// What --write names must be there to write.
void require_what_is_written(const RegisterOptions& o);
/// What the options of update must agree on with those that the patient was prepared with, which `o` holds by now.
void complete_with_patient(RegisterOptions& o, const std::filesystem::path& patient);

}  // namespace tissuewarp::apps
