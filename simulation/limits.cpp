#include "simulation/limits.hpp"

#include "core/errors.hpp"

#include <string>

namespace tissuewarp::simulation {

bool has_effects(const Scene& scene) {
    return scene.fluid || !scene.pressures.empty() || !scene.membranes.empty() || !scene.contacts.empty() ||
           !scene.sliding.empty();
}

void require_supported(const Scene& scene) {
    if (scene.solve.kind == Solve::Kind::Equilibrium)
        for (const Contact& contact : scene.contacts)
            if (contact.friction > 0)
                throw InvalidInput(
                    "friction depends on the way to an equilibrium; give [solve] kind = \"dynamics\", or "
                    "no friction");
    for (const auto& [label, tissue] : scene.tissues)
        if (tissue.growth != 1.0)
            throw InvalidInput("growth of label " + std::to_string(label) +
                               " is not available; leave 'growth' out of [label." + std::to_string(label) + "]");
    if (scene.solve.device == Device::Gpu && has_effects(scene))
        throw InvalidInput(
            "the GPU does not take fluid, pressure, membranes, contact and sliding; give [solve] device = "
            "\"cpu\"");
}

}  // namespace tissuewarp::simulation
