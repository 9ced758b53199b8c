#pragma once
/// The discrete energy in plain float64 scalar code, its exact gradient and Hessian, and a static Newton solver on it:
/// slow, simple, and what every engine is tested against.

#include "core/observer.hpp"
#include "tled/conditions.hpp"
#include "tled/discrete_energy.hpp"
#include "tled/rest_state.hpp"

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include <vector>

namespace tissuewarp::tled {

/// Elastic energy of a displacement (3 × N mm), mN·mm.
double elastic_energy(const RestState& rest, const Eigen::Matrix3Xd& displacement);

/// f_int = ∂E/∂u, mN, 3 × N.
Eigen::Matrix3Xd internal_force(const RestState& rest, const Eigen::Matrix3Xd& displacement);

/// Viscous stresses q_i (second Piola–Kirchhoff, kPa) of every element, in the internal order, tetrahedra before
/// hexahedra; elements of elastic materials have none.
using ViscousStresses = std::vector<std::vector<Eigen::Matrix3d>>;

/// No stress in any term.
ViscousStresses unstressed(const RestState& rest);

/// The viscous stresses after an interval (s) at a displacement (viscosity.hpp).
ViscousStresses advanced(const RestState& rest, ViscousStresses stresses, const Eigen::Matrix3Xd& displacement,
                         double interval);

/// f_int with the viscous stresses taken off: P = ∂W/∂F − F Σ q_i, mN, 3 × N.
Eigen::Matrix3Xd internal_force(const RestState& rest, const Eigen::Matrix3Xd& displacement,
                                const ViscousStresses& stresses);

/// ∂²E/∂u² (3N × 3N, mN/mm, symmetric, both triangles stored), degree of freedom 3·node + component.
Eigen::SparseMatrix<double> tangent_stiffness(const RestState& rest, const Eigen::Matrix3Xd& displacement);

/// det F of every element, tetrahedra before hexahedra, in the order of the mesh.
Eigen::VectorXd jacobians(const RestState& rest, const Eigen::Matrix3Xd& displacement);

struct NewtonOptions {
    double tolerance_mm = 1e-9;  ///< largest nodal correction at which the iteration ends
    int max_iterations = 60;
    int load_steps = 1;  ///< imposed displacements, targets and forces applied in equal parts
    /// Where to begin (3 × N, mm), near an equilibrium under the forces and targets, which then act in full; empty: at
    /// rest. For loads along a path, and for conditions that change from one solution to the next.
    Eigen::Matrix3Xd start{};
};

struct NewtonResult {
    Eigen::Matrix3Xd displacement;  ///< 3 × N, mm
    int iterations = 0;
    double last_correction_mm = 0;
};

/// Static equilibrium by Newton's method with a CHOLMOD factor per iteration and a line search that keeps J > 0 and the
/// energy falling; adds a multiple of the diagonal where the tangent is indefinite. Throws SolverFailure, and
/// InvalidInput where a piece of tissue is not held.
NewtonResult newton_equilibrium(const RestState& rest, const NodalConditions& conditions,
                                const NewtonOptions& options = {}, Observer& observer = silent_observer());

/// The same for any discretisation. Precondition: the conditions hold it against rigid motion.
NewtonResult newton_equilibrium(const DiscreteEnergy& energy, const NodalConditions& conditions,
                                const NewtonOptions& options = {}, Observer& observer = silent_observer());

}  // namespace tissuewarp::tled
