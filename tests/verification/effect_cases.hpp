#pragma once
/// Every effect in a scene whose answer is known in closed form, or from an independent computation.

#include "tests/verification/transient.hpp"

#include <ostream>
#include <string>
#include <vector>

namespace tissuewarp::verification {

/// One number of a scene. What a failure would look like stands in `source`'s terms: another number.
struct EffectCase {
    std::string effect, scene, quantity, unit;
    std::string source;  ///< of the reference
    double reference = 0.0;
    double bound =
        0.0;  ///< accepted difference, in the same unit: of the mesh, the time step or the solver's tolerance
    double (*measure)(const MakeEngine& engine) = nullptr;
};

inline void PrintTo(const EffectCase& each, std::ostream* out) {
    *out << each.scene << ", " << each.quantity;
}

/// All but those of whole scenes.
std::vector<EffectCase> effect_cases();
/// Those of contact and friction, which are among them.
std::vector<EffectCase> contact_cases();
/// What changes in time, by whole scenes; where simulation is built.
std::vector<EffectCase> scene_cases();
/// Those of fibres that vary in space, which are among them.
std::vector<EffectCase> fibre_cases();
/// Those of surfaces that may part, likewise.
std::vector<EffectCase> parting_cases();

}  // namespace tissuewarp::verification
