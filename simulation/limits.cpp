#include "simulation/limits.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <string>

namespace tissuewarp::simulation {

bool needs_cpu(const Scene& scene) {
    const bool grows = std::any_of(scene.tissues.begin(), scene.tissues.end(),
                                   [](const auto& entry) { return entry.second.growth != 1.0; });
    return grows || scene.fluid || !scene.pressures.empty() || !scene.membranes.empty() || !scene.contacts.empty() ||
           !scene.sliding.empty();
}

void require_supported(const Scene& scene) {
    if (scene.solve.kind == Solve::Kind::Equilibrium)
        for (const Contact& contact : scene.contacts)
            if (contact.friction > 0)
                throw InvalidInput(
                    "friction depends on the way to an equilibrium; give [solve] kind = \"dynamics\", or "
                    "no friction");
    if (scene.solve.device == Device::Gpu && needs_cpu(scene))
        throw InvalidInput(
            "the GPU does not take growth, fluid, pressure, membranes, contact and sliding; give [solve] device = "
            "\"cpu\"");
}

}  // namespace tissuewarp::simulation
