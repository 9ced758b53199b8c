#pragma once
/// What each effect of a scene changes, and what it costs.

#include "simulation/scene.hpp"

#include "core/observer.hpp"

#include <functional>
#include <string>
#include <vector>

namespace tissuewarp::simulation {

/// Something that a scene can do without.
struct Removable {
    std::string name;  ///< "gravity", "springs on 'base'", …
    std::function<void(Scene&)> remove;
};

/// Everything but what is fixed, in the order of Scene. A fluid goes where gravity goes, which it needs.
std::vector<Removable> removable(const Scene& scene);

struct Change {
    std::string effect;
    std::string failure;  ///< why the scene cannot run without it; the numbers below mean nothing then
    double probes_mean_mm = 0, probes_max_mm = 0;  ///< |difference of the last frames| over the probes of both
    double nodes_mean_mm = 0, nodes_max_mm = 0;    ///< over the nodes of both
    double seconds = 0;                            ///< that the solution takes longer with it
};

struct Ablation {
    double seconds = 0;  ///< of the whole scene's solution
    std::vector<Change> changes;
};

/// Runs the scene, and again without each effect, on one mesh. Throws what build() and simulate() throw for the whole
/// scene; Cancelled.
Ablation ablate(const Scene& scene, Observer& observer = silent_observer());

}  // namespace tissuewarp::simulation
