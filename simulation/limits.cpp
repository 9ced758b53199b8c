#include "simulation/limits.hpp"

#include "core/errors.hpp"

#include <string>

namespace tissuewarp::simulation {

void require_supported(const Scene& scene) {
    if (scene.solve.kind == Solve::Kind::Equilibrium && !scene.contacts.empty())
        throw InvalidInput("an equilibrium in contact is not available; give [solve] kind = \"dynamics\", which is");
    for (const auto& [label, tissue] : scene.tissues)
        if (tissue.growth != 1.0)
            throw InvalidInput("growth of label " + std::to_string(label) +
                               " is not available; leave 'growth' out of [label." + std::to_string(label) + "]");
    const bool effects = scene.fluid || !scene.pressures.empty() || !scene.membranes.empty() ||
                         !scene.contacts.empty() || !scene.sliding.empty();
    if (effects)
        throw InvalidInput(
            "no engine takes fluid, pressure, membranes, contact and sliding; leave them out of the scene");
}

}  // namespace tissuewarp::simulation
