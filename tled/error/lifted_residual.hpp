#pragma once
/// What a solver left: the algebraic part of the error of a result.

#include "tled/conditions.hpp"
#include "tled/stiffness/rest_stiffness.hpp"

#include <Eigen/Core>

namespace tissuewarp::tled {

/// K₀⁻¹ r, 3 × N mm: to first order the equilibrium of the discrete model less `displacement` (3 × N mm), r the
/// residual force there in float64, whatever engine found the displacement. K₀ knows nothing of the deformation: near
/// an equilibrium with large strains the true error was up to 1.5 times this (docs/decisions/equilibrium.md). Zero
/// where displacements are prescribed. Contact is not in it but by the springs that hold nodes which touch.
///
/// Throws SolverFailure where det F ≤ 0, InvalidInput for constraints other than those of `stiffness`.
Eigen::Matrix3Xd lifted_residual(const RestState& rest, const RestStiffness& stiffness,
                                 const NodalConditions& conditions, const Eigen::Matrix3Xd& displacement);

}  // namespace tissuewarp::tled
