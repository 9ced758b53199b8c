#pragma once
/// Does the estimated error of linear tetrahedra have the size of the true one?

#include "tests/verification/solution.hpp"
#include "tled/error/discretisation_error.hpp"

#include <cmath>
#include <string>
#include <vector>

namespace tissuewarp::verification {

/// A displacement of one problem on one mesh, or many in the root mean square, mm.
struct Effectivity {
    std::string quantity;
    double estimated = 0;    ///< size of the estimated error
    double actual = 0;       ///< distance from the reference
    double uncertain = 0;    ///< of the reference
    double left = 0;         ///< distance from the reference once the estimate has been added
    double quadratic = NAN;  ///< distance from a solution by quadratic tetrahedra

    [[nodiscard]] double index() const { return estimated / actual; }
    /// Does the reference know the error to a fifth?
    [[nodiscard]] bool judged() const { return uncertain < 0.2 * actual; }
    /// The bar of the estimate.
    [[nodiscard]] bool met() const { return index() >= 0.5 && index() <= 2.0; }
};

struct EffectivityStudy {
    int tetrahedra = 0, iterations = 0;
    std::string reason;  ///< why there is no estimate
    std::vector<Effectivity> quantities;
};

/// Solves the problem with linear tetrahedra on a level and estimates the error of all its displacements; `quadratic`
/// is a solution on the same level or null. Precondition: no contact.
EffectivityStudy effectivity(const Problem& problem, Elements elements, int level, const Solution* quadratic = nullptr);

}  // namespace tissuewarp::verification
