#pragma once
/// What scenes can say and the solver cannot do yet.

#include "simulation/scene.hpp"

namespace tissuewarp::simulation {

/// Whether the scene holds what only the CPU's engine takes: effects on tissue where it is now (tled/effects.hpp).
bool needs_cpu(const Scene& scene);

/// Throws InvalidInput with the remedy.
void require_supported(const Scene& scene);

}  // namespace tissuewarp::simulation
