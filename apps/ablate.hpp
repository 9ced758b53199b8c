#pragma once
/// The table that --ablate prints.

#include "simulation/ablation.hpp"

namespace tissuewarp::apps {

void print_ablation(const simulation::Ablation& ablation, bool has_probes);

}  // namespace tissuewarp::apps
