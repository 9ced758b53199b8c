#pragma once
/// The one-point hexahedron in plain float64: rest data, energy and its derivatives (tled/hex_state.hpp).

#include "tled/material/constitutive.hpp"
#include "tled/model/internal_force.hpp"
#include "tled/rest_state.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::tled::detail {

/// Fills what depends on the geometry for the order of `state.hex`, and adds an eighth of each hexahedron's mass to
/// `lumped_mass` (kg) at its corners.
void precompute_hexahedra(const Model& model, const std::vector<Material>& materials, HexState& state,
                          Eigen::VectorXd& lumped_mass);

/// Mean ∇N of the corners, 3 × 8, 1/mm.
Eigen::Matrix<double, 3, 8> hex_shape_gradients(const HexState& state, int element);

/// γ_α of the corners in the columns, 8 × 4.
Eigen::Matrix<double, 8, 4> hourglass_vectors(const HexState& state, int element);

/// Mean F of one hexahedron of the internal order for displacements 3 × N.
Eigen::Matrix3d hex_deformation_gradient(const HexState& state, const Eigen::Matrix3Xd& displacement, int element);

/// The material of a hexahedron, with its own fibre direction; `material` from material_of_elements().
Material hex_material(const RestState& rest, int material, int element);

/// det F of every hexahedron in the internal order.
Eigen::VectorXd hex_jacobians(const HexState& state, const Eigen::Matrix3Xd& displacement);

/// Energy of all hexahedra, mN·mm.
double hex_energy(const RestState& rest, const Eigen::Matrix3Xd& displacement);

/// Internal forces by corners, viscous stresses taken off: column 8·element + corner, mN. Precondition:
/// require_positive_hexahedra.
Eigen::Matrix3Xd hex_corner_forces(const RestState& rest, const Eigen::Matrix3Xd& displacement,
                                   const ViscousStresses& stresses);

/// Throws SolverFailure naming the first hexahedron with det F ≤ 0 whose law does not admit it.
void require_positive_hexahedra(const RestState& rest, const Eigen::VectorXd& jacobian);

}  // namespace tissuewarp::tled::detail
