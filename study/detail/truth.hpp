#pragma once
/// The true deformation of a random organ: quadratic tetrahedra in equilibrium.

#include "study/detail/organ_shape.hpp"
#include "study/detail/random_loads.hpp"
#include "study/detail/random_tissue.hpp"

#include "core/observer.hpp"
#include "tled/quadratic.hpp"

#include <Eigen/Core>

namespace tissuewarp::study::detail {

/// Curved tetrahedra of the organ at rest. `elements`: how many, about.
struct TruthMesh {
    meshing::TetMesh corners;
    tled::QuadraticMesh quadratic;
};
TruthMesh truth_mesh(const OrganShape& shape, int elements, Observer& observer);

struct Truth {
    TruthMesh mesh;
    Eigen::Matrix3Xd displacement;  ///< 3 × N mm, moving frame
    double min_jacobian = 1;
};

/// Equilibrium under loads that are scaled until linear elasticity would move no node by more than `motion_mm`. Throws
/// SolverFailure where Newton's method fails or the tissue is crushed or torn apart: det F out of 0.3 … 3, or a motion
/// beyond twice the one wanted.
Truth deformed_organ(const OrganShape& shape, const RandomTissue& tissue, const RandomLoads& loads, double motion_mm,
                     int elements, Observer& observer);

}  // namespace tissuewarp::study::detail
