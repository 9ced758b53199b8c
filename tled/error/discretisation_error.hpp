#pragma once
/// What linear tetrahedra of this size miss: the error of an equilibrium, estimated by quadratic bubbles on all edges
/// (Bank and Smith, SIAM J. Numer. Anal. 30 (1993) 921; Deuflhard, Leinen, Yserentant, IMPACT Comput. Sci. Eng. 1
/// (1989) 3). docs/method.md, section 14.

#include "tled/conditions.hpp"
#include "tled/model.hpp"
#include "tled/stiffness/rest_stiffness.hpp"

#include <Eigen/Core>

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::tled {

/// A dead traction (kPa of rest area) on the face of three corners.
struct FaceTraction {
    std::array<int, 3> corners{};
    Eigen::Vector3d traction = Eigen::Vector3d::Zero();
};

/// Loads between the nodes. What they put on the nodes is in the external forces of the conditions already.
struct DistributedLoads {
    Eigen::Vector3d body_force = Eigen::Vector3d::Zero();  ///< mN/mm³ of rest volume
    std::vector<FaceTraction> tractions{};
};

/// u − u_h = Σ corner_a L_a + Σ bubble_ab 4 L_a L_b.
struct DiscretisationError {
    Eigen::Matrix3Xd corner;  ///< 3 × N, mm
    Eigen::Matrix3Xd bubble;  ///< 3 × E, mm: in the middle of every edge, beyond the mean of its ends
    Eigen::Matrix2Xi edge;    ///< 2 × E, corners of every edge, the smaller first, ascending
    Eigen::Matrix<int, 6, Eigen::Dynamic> edges_of;  ///< 6 × M, edges 01, 12, 02, 03, 13, 23 of every tetrahedron
    int iterations = 0;                              ///< of conjugate gradients
    double seconds = 0;

    /// At barycentric coordinates of a tetrahedron of `mesh`, which is that of the model, mm.
    [[nodiscard]] Eigen::Vector3d at(const meshing::TetMesh& mesh, int tet, const Eigen::Vector4d& barycentric) const;
};

struct DiscretisationOptions {
    double relative_tolerance = 0.01;  ///< of conjugate gradients, in the norm of their preconditioner
    int max_iterations = 1000;
};

/// The estimate, or why there is none.
struct DiscretisationEstimate {
    std::optional<DiscretisationError> error;
    std::string reason;  ///< empty where there is an estimate
};

/// Of `displacement` (3 × N mm), linear tetrahedra in equilibrium under `conditions`; what the solver left is no part
/// of it. One Newton step from there with quadratic tetrahedra on the same mesh, whose volumetric energy averages J at
/// the corners in tissue of ν > 0.46 and does not elsewhere (suggested_element): locking is seen. Where all three
/// corners of a boundary or interface face are prescribed, so is what lies between, linearly; where springs hold them,
/// they hold it too, by area. `stiffness` of these constraints, best of these springs, is the preconditioner on the
/// corners.
///
/// No estimate, with the reason: effects other than nodal forces; det F ≤ 0 somewhere; tissue that buckles
/// between the nodes; no convergence; loads that are not finite. Throws InvalidInput where sizes or constraints do not
/// fit, tractions are on no face, or the model is invalid.
DiscretisationEstimate discretisation_error(const Model& model, const RestStiffness& stiffness,
                                            const NodalConditions& conditions, const Eigen::Matrix3Xd& displacement,
                                            const DistributedLoads& loads = {},
                                            const DiscretisationOptions& options = {});

}  // namespace tissuewarp::tled
