#pragma once
/// What scenes can say and the solver cannot do yet.

#include "simulation/scene.hpp"

namespace tissuewarp::simulation {

/// Throws InvalidInput with the remedy.
void require_supported(const Scene& scene);

}  // namespace tissuewarp::simulation
