#pragma once
/// From costs of shifts to where tissue belongs.

#include "registration/matching/dense/dense_force.hpp"
#include "registration/matching/ultrasound/echo_costs.hpp"

namespace tissuewarp::registration::detail {

/// What a minimum of costs says. Chosen on `study coverage --problems ultrasound:1-12` (docs/decisions/ultrasound.md).
struct EchoInformation {
    double independent_mm3 = 30;    ///< of ultrasound that say one thing of their own
    double leakage = 0.05;          ///< as BlockInformationRules::leakage
    double least_deviation = 0.1;   ///< steps: what interpolation leaves
    double story_mm = 12;           ///< deviation of the window in which shifts are expected to be alike …
    double story_deviation_mm = 2;  ///< … to this deviation
    int story_rounds = 4;
};

struct EchoMatches {
    std::vector<DenseForce> forces;  ///< where the images say something
    double agreement = 0;            ///< of the variance that chance leaves, what is explained without a shift
};

/// The window is that of the costs. Places choose among minima that are nearly as low the one that their neighbours'
/// choices speak for (coupled convex optimisation; Heinrich et al., MICCAI 2014).
EchoMatches echo_matches(const EchoCosts& costs, double window_mm, const EchoInformation& rules = {});

}  // namespace tissuewarp::registration::detail
