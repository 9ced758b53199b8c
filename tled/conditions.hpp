#pragma once
/// What acts on the model: springs to targets, prescribed displacements, forces, effects.

#include "tled/nodal_effects.hpp"

#include <Eigen/Core>

#include <array>
#include <vector>

namespace tissuewarp::tled {

/// Energy ½ (u − target)ᵀ K (u − target) at one node. Several springs on a node add up.
struct Spring {
    int node = -1;
    Eigen::Matrix3d stiffness = Eigen::Matrix3d::Zero();  ///< K, mN/mm, symmetric positive semi-definite
    Eigen::Vector3d target = Eigen::Vector3d::Zero();     ///< displacement that the spring pulls to, mm
};

/// Displacement components that are imposed, a zero included. `constrained[c]` says which.
struct PrescribedDisplacement {
    int node = -1;
    std::array<bool, 3> constrained{true, true, true};
    Eigen::Vector3d displacement = Eigen::Vector3d::Zero();  ///< mm
};

struct Conditions {
    std::vector<Spring> springs;
    std::vector<PrescribedDisplacement> prescribed;  ///< at most one per node
    Eigen::Matrix3Xd external_force;                 ///< mN, 3 × N or empty
    Effects effects;
};

/// Conditions in the form that engines take: per node one summed spring K and K·target, a mask and imposed values.
struct NodalConditions {
    Eigen::Matrix<double, 6, Eigen::Dynamic> spring_stiffness;  ///< mN/mm, rows as tled/model/symmetric.hpp; 6 × S
    Eigen::Matrix3Xd spring_force;                              ///< K·target, mN, 3 × S
    std::vector<int> spring_node;                               ///< S, ascending
    Eigen::Matrix<bool, 3, Eigen::Dynamic> constrained;         ///< 3 × N
    Eigen::Matrix3Xd imposed;                                   ///< mm, 3 × N, zero where free
    Eigen::Matrix3Xd external_force;                            ///< mN, 3 × N
    NodalEffects effects;
};

/// Throws InvalidInput on node indices out of range, a node prescribed twice, non-finite values, a stiffness that is
/// not symmetric positive semi-definite, or effects that nodal_effects() refuses.
NodalConditions nodal_conditions(const Conditions& conditions, const RestState& rest);
/// The same for conditions without effects, which are all that can do without a rest state; throws InvalidInput where
/// there are any.
NodalConditions nodal_conditions(const Conditions& conditions, int node_count);

/// `conditions` with these springs too. Throws InvalidInput for what nodal_conditions() refuses.
NodalConditions with_springs(NodalConditions conditions, const std::vector<Spring>& more);

/// Forces, pressures, weights, targets of springs and imposed displacements times `part`; what holds is as it was.
NodalConditions scaled(NodalConditions conditions, double part);

}  // namespace tissuewarp::tled
