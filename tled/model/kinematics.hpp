#pragma once
/// What the scalar reference computes in every element, shared by forces and stiffness.

#include "tled/material/constitutive.hpp"
#include "tled/rest_state.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::tled::detail {

/// ∇N of the four corners, 3 × 4, 1/mm.
Eigen::Matrix<double, 3, 4> shape_gradients(const RestState& rest, int element);

/// F of one element of the internal order for displacements 3 × N.
Eigen::Matrix3d deformation_gradient(const RestState& rest, const Eigen::Matrix3Xd& displacement, int element);

/// The material of an element, with its own fibre direction; `material` from material_of_elements().
Material element_material(const RestState& rest, int material, int element);

/// U and derivatives at every pressure node, times M_a (kPa); empty for T4. `jacobian` is det F of every element.
std::vector<VolumetricFunction> nodal_volumetric(const RestState& rest, const Eigen::VectorXd& jacobian);

/// p_e = M_e U'(J_e) + ¼ Σ_a M_a U'(J_a), kPa, positive in extension.
double element_pressure(const RestState& rest, int element, const Material& material, double J,
                        const std::vector<VolumetricFunction>& nodal);

/// det F of every element in the internal order.
Eigen::VectorXd element_jacobians(const RestState& rest, const Eigen::Matrix3Xd& displacement);

/// Throws SolverFailure naming the first element with det F ≤ 0 whose law does not admit it.
void require_positive(const RestState& rest, const Eigen::VectorXd& jacobian);

}  // namespace tissuewarp::tled::detail
