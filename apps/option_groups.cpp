#include "apps/option_groups.hpp"

namespace tissuewarp::apps {

namespace {

HelpLayout layout_of_register() {
    return {
        {"--moving", "--moving-labels", "--fixed", "--fixed-labels", "--fixed-surface", "--fixed-points", "--no-align",
         "--default-poissons-ratio", "--time-budget", "--landmarks", "--dry-run", "--output"},
        {{"What moves", {"--moving", "--moving-labels", "--moving-surface", "--moving-mesh", "--label-names"}},
         {"What was seen",
          {"--fixed", "--fixed-labels", "--fixed-surface", "--fixed-points", "--moving-points", "--moving-curves",
           "--fixed-curves", "--match-image", "--similarity", "--moving-mask", "--fixed-mask", "--resample-labels"}},
         {"How well it was seen", {"--surface-sd", "--points-sd", "--curves-sd", "--data-stiffness"}},
         {"Where the organ lies", {"--no-align", "--initial-transform", "--anchor", "--rigid-neighbour", "--sliding"}},
         {"Tissue",
          {"--materials", "--tissue", "--label-tissue", "--default-youngs-modulus", "--default-poissons-ratio",
           "--element", "--resected"}},
         {"Accuracy and time",
          {"--accuracy", "--time-budget", "--edge-length", "--label-edge-length", "--rounds", "--tolerance", "--fade",
           "--no-error-estimate", "--device", "--threads"}},
         {"What is written",
          {"--output", "--landmarks", "--landmarks-moving", "--landmarks-fixed", "--points", "--surface", "--write",
           "--bids", "--strict"}},
         {"Runs", {"--config", "--save-parameters", "--dry-run", "--quiet"}}}};
}

HelpLayout layout_of_evaluate() {
    return {{"--labels", "--reference-labels", "--landmarks", "--displacement", "--inverse", "--mask", "--json"},
            {{"Label maps", {"--labels", "--reference-labels", "--label-names"}},
             {"Landmarks",
              {"--landmarks", "--landmarks-moving", "--landmarks-fixed", "--moved", "--moving-labels", "--data-surface",
               "--data-points", "--bin-edges"}},
             {"Fields", {"--displacement", "--inverse", "--mask"}},
             {"Curves and surfaces that were not registered to", {"--moving-curves", "--fixed-curves", "--held-out"}},
             {"Runs", {"--json", "--threads", "--quiet"}}}};
}

}  // namespace

HelpLayout help_layout(const std::string& verb) {
    if (verb == "register") return layout_of_register();
    if (verb == "evaluate") return layout_of_evaluate();
    return {};
}

}  // namespace tissuewarp::apps
