#include "simulation/limits.hpp"

#include "core/errors.hpp"

namespace tissuewarp::simulation {

void require_supported(const Scene& scene) {
    if (scene.solve.kind == Solve::Kind::Equilibrium)
        for (const Contact& contact : scene.contacts)
            if (contact.friction > 0)
                throw InvalidInput(
                    "friction depends on the way to an equilibrium; give [solve] kind = \"dynamics\", or "
                    "no friction");
}

}  // namespace tissuewarp::simulation
