#pragma once
/// Displacements that turn tissue by finite angles, from increments that are linear in them.

#include "tled/conditions.hpp"
#include "tled/rest_state.hpp"
#include "tled/stiffness/cholmod_factor.hpp"

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include <array>
#include <memory>
#include <vector>

namespace tissuewarp::tled::detail {

/// A linear increment stretches what it turns: a rod that hangs grows longer by 1 − cos⁻¹ of its slope, and Newton's
/// method then spends its steps on taking that back. Here each tetrahedron turns by the angle of the increment, and the
/// nodes go where they fit all tetrahedra best (rotation–strain coordinates: Huang, Tong, Zhou, Bao, Desbrun, IEEE
/// Trans. Vis. Comput. Graph. 17 (2011) 983).
class FiniteRotations {
public:
    /// Factorises three scalar Laplacians, one for each axis. Tissue outlives this.
    FiniteRotations(const RestState& rest, const NodalConditions& conditions);

    /// From a displacement by an increment (3 × N, mm), which is zero where conditions impose: F becomes
    /// exp(ω) (1 + ε) F with the increment's spin ω and strain ε in every tetrahedron, as nearly as nodes allow, by
    /// least squares with weights μ V.
    [[nodiscard]] Eigen::Matrix3Xd moved(const Eigen::Matrix3Xd& displacement, const Eigen::Matrix3Xd& increment) const;

    /// The displacement with F as nearly as nodes allow that of `other` (3 × N, mm; of the same tissue, and not quite
    /// under the same conditions), where the degrees of freedom that conditions constrain are as in `imposed`. What
    /// stays inside out is pushed to the nearest F that is not, more and more (after Bouaziz, Martin, Liu, Kavan,
    /// Pauly, ACM Trans. Graph. 33 (2014) 154), for a while.
    [[nodiscard]] Eigen::Matrix3Xd like(const Eigen::Matrix3Xd& other, const NodalConditions& imposed) const;

private:
    /// A displacement brought to where its tetrahedra fit their goals for F best.
    [[nodiscard]] Eigen::Matrix3Xd fitted(Eigen::Matrix3Xd displacement,
                                          const std::vector<Eigen::Matrix3d>& goal) const;

    const RestState& rest_;
    Eigen::VectorXd weight_;                 ///< M, μ V
    Eigen::SparseMatrix<double> laplacian_;  ///< N × N, Σ μ V ∇N_a · ∇N_b
    struct Axis {
        std::vector<int> free;  ///< nodes, ascending
        std::unique_ptr<CholmodFactor> factor;
    };
    std::array<Axis, 3> axes_;
};

}  // namespace tissuewarp::tled::detail
