#pragma once
/// The true deformation of a random organ: quadratic tetrahedra in equilibrium.

#include "study/detail/organ_shape.hpp"
#include "study/detail/random_loads.hpp"
#include "study/detail/random_tissue.hpp"

#include "core/observer.hpp"
#include "tled/reference/quadratic.hpp"

#include <Eigen/Core>

namespace tissuewarp::study::detail {

/// Curved tetrahedra of the organ at rest.
struct TruthMesh {
    meshing::TetMesh corners;
    tled::QuadraticMesh quadratic;
};
/// Of about so many elements.
TruthMesh truth_mesh(const OrganShape& shape, int elements, Observer& observer = silent_observer());

/// Everything that a truth follows from but its mesh.
struct RandomOrgan {
    OrganShape shape;
    RandomTissue tissue;
    RandomLoads loads;
};
RandomOrgan random_organ(Random& random);

tled::QuadraticTetrahedra elements_of(const TruthMesh& mesh, const RandomTissue& tissue);

/// The smallest det F. Throws SolverFailure where tissue is crushed or torn apart (out of 0.3 … 3).
double bearable_jacobians(const tled::QuadraticTetrahedra& energy, const Eigen::Matrix3Xd& displacement);

/// The organ's loads scaled so that linear elasticity would move no node by more than `motion_mm`.
RandomLoads sized_loads(const RandomOrgan& organ, const TruthMesh& mesh, double motion_mm);

struct Truth {
    TruthMesh mesh;
    Eigen::Matrix3Xd displacement;  ///< 3 × N mm, moving frame
    double min_jacobian = 1;
};

/// Equilibrium under the organ's loads. Throws SolverFailure where Newton's method fails or tissue is crushed or torn
/// apart (det F out of 0.3 … 3), InvalidInput where a curved element is turned inside out at rest.
Truth equilibrium(const RandomOrgan& organ, TruthMesh mesh, Observer& observer = silent_observer());

}  // namespace tissuewarp::study::detail
