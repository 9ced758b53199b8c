#pragma once
/// How far off tissue is expected to lie.

#include "registration/pipeline.hpp"
#include "tled/conditions.hpp"

namespace tissuewarp::registration::detail {

/// Springs of the data and of the prior, each weighed so that `energy` (mN mm) is one standard deviation.
struct WeighedSprings {
    std::vector<tled::Spring> data, ground;
    double energy = 1;
    bool free_placement = false;  ///< the organ may lie anywhere: the ground moves with it
};

/// exp(−Π/energy) is Gaussian for small displacements, of covariance energy · K⁻¹, K the stiffness at rest with all
/// springs (Bayes' rule with strain energy as the prior, e.g. Szeliski 1990). Where the placement is free, the ground
/// G is G − G R (Rᵀ G R)⁻¹ Rᵀ G, R the six rigid motions: it holds no motion as a whole. Such motions that
/// the data do not show either are taken to be known to 100 mm. Looks at 16 nodes, each the farthest from those before.
ExpectedError expected_error(const PreparedModel& prepared, const WeighedSprings& springs);

}  // namespace tissuewarp::registration::detail
