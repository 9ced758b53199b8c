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

private:
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
