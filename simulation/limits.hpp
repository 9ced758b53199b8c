#pragma once
/// What scenes can say and the solver cannot do yet.

#include "simulation/scene.hpp"

namespace tissuewarp::simulation {

/// Whether anything acts on the tissue where it is now (tled/effects.hpp).
bool has_effects(const Scene& scene);

/// Throws InvalidInput with the remedy.
void require_supported(const Scene& scene);

}  // namespace tissuewarp::simulation
