#pragma once
/// What the conditions at nodes mean for the bubbles between them.

#include "meshing/tet_mesh.hpp"
#include "tled/conditions.hpp"
#include "tled/error/discretisation_error.hpp"
#include "tled/error/hierarchical_space.hpp"

#include <Eigen/Core>

#include <utility>
#include <vector>

namespace tissuewarp::tled::detail {

struct BubbleConditions {
    Eigen::Matrix<bool, 3, Eigen::Dynamic> constrained;      ///< 3 × E: what is prescribed on a face is linear on it
    Eigen::Matrix3Xd force;                                  ///< 3 × E, mN
    std::vector<std::pair<int, Eigen::Matrix3d>> stiffness;  ///< of springs: edge, mN/mm; an edge may come twice
};

/// Springs on all three corners of a boundary or interface face stand for a spring on the face: k and its force per
/// area, linear between the nodes, those of a node spread over the faces around it by their area; the coupling of
/// bubbles with corners by them is left out. `volume` (mm³) of the tetrahedra in the order of `space`; `displacement` 3
/// × N mm.
BubbleConditions bubble_conditions(const HierarchicalSpace& space, const Eigen::VectorXd& volume,
                                   const meshing::TetMesh& mesh, const NodalConditions& conditions,
                                   const Eigen::Matrix3Xd& displacement, const DistributedLoads& loads);

}  // namespace tissuewarp::tled::detail
