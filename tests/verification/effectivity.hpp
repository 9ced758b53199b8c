#pragma once
/// Does the estimated discretisation error have the size of the true one?

#include "tests/verification/solution.hpp"
#include "tled/discretisation_error.hpp"

#include <string>
#include <vector>

namespace tissuewarp::verification {

/// One displacement (or many, in the root mean square) of one problem on one mesh, mm.
struct Effectivity {
    std::string quantity;
    double estimated = 0;  ///< size of the estimated error
    double actual = 0;     ///< distance from the reference
    double uncertain = 0;  ///< of the reference
    double left = 0;       ///< distance from the reference after the estimate has been added

    [[nodiscard]] double index() const { return estimated / actual; }
    /// Is the reference known well enough to judge an estimate?
    [[nodiscard]] bool judged() const { return uncertain < 0.2 * actual; }
};

struct EffectivityStudy {
    int nodes = 0, tetrahedra = 0, iterations = 0;
    double seconds = 0;
    std::string reason;  ///< why there is no estimate
    std::vector<Effectivity> quantities;
};

/// Solves the problem with linear tetrahedra and estimates their error; quantities in mm. Precondition: no contact.
EffectivityStudy effectivity(const Problem& problem, Elements elements, int level);

}  // namespace tissuewarp::verification
