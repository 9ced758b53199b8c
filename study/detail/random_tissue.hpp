#pragma once
/// Tissue of a law, stiffness and Poisson's ratio that the registration does not know.

#include "study/detail/random.hpp"

#include "tled/material.hpp"

#include <string>

namespace tissuewarp::study::detail {

struct RandomTissue {
    tled::MaterialTable materials;  ///< of labels 1 and 2
    double youngs_modulus_kpa = 0;  ///< of label 1, at rest
    double stiffness_ratio = 1;     ///< of label 2 to label 1
    double poisson_ratio = 0;
    std::string law;
};

/// 1–10 kPa, ν 0.40–0.49, the inclusion 0.5–10 times as stiff and of the same law.
RandomTissue random_tissue(Random& random);

}  // namespace tissuewarp::study::detail
