// tissuewarp simulate --ablate: what each effect of a scene changes and costs.

#include "apps/ablate.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

void print_ablation(const simulation::Ablation& ablation, bool has_probes) {
    fmt::print("the whole scene takes {:.0f} ms; without each effect in turn, the last frame differs by\n",
               1e3 * ablation.seconds);
    fmt::print("{:<40}{:>22}{:>22}{:>12}\n", "", has_probes ? "probes mean, max (mm)" : "", "nodes mean, max (mm)",
               "costs (ms)");
    for (const simulation::Change& change : ablation.changes) {
        if (!change.failure.empty()) {
            fmt::print("{:<40}  cannot do without it: {}\n", change.effect, change.failure);
            continue;
        }
        const std::string probes =
            has_probes ? fmt::format("{:>11.3f}{:>11.3f}", change.probes_mean_mm, change.probes_max_mm) : "";
        fmt::print("{:<40}{:>22}{:>11.3f}{:>11.3f}{:>12.0f}\n", change.effect, probes, change.nodes_mean_mm,
                   change.nodes_max_mm, 1e3 * change.seconds);
    }
}

}  // namespace tissuewarp::apps
