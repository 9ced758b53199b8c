#pragma once
/// The stiffness of large meshes in two levels: smooth displacements, which are few, and what is rough about them.

#include "tled/stiffness/cholmod_factor.hpp"
#include "tled/stiffness/lattice.hpp"
#include "tled/stiffness/product.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::tled::detail {

/// Of a symmetric positive definite K; what holds and why: docs/decisions/rest_stiffness.md.
class TwoLevel {
public:
    /// K with all its rows, zero in those of constrained degrees of freedom; `multiply` is by the same matrix. About
    /// `cells` cells of the lattice hold nodes. Throws InvalidInput where K is not positive definite.
    TwoLevel(const BlockRows& K, Product multiply, const Eigen::Matrix3Xd& position,
             const Eigen::Matrix<bool, 3, Eigen::Dynamic>& constrained, int cells);

    /// Cells for a mesh of so many nodes: one to 14 nodes, 3000 at most. Chosen on *brainshift*.
    static int suggested_cells(Eigen::Index nodes);

    /// P (Pᵀ K P)⁻¹ Pᵀ of many forces, 3N × k: the smooth displacements of least energy. Between nothing and K⁻¹.
    [[nodiscard]] Eigen::MatrixXd smooth_columns(const Eigen::MatrixXd& forces) const;

    /// About K⁻¹ r, 3 × N, symmetric and positive definite: rough steps, smooth ones, rough ones again (Briggs, Henson,
    /// McCormick, A Multigrid Tutorial (2000), chapter 3).
    [[nodiscard]] Eigen::Matrix3Xd cycle(Eigen::Matrix3Xd residual) const;

private:
    Lattice lattice_;
    Product multiply_, divide_;
    Eigen::Matrix<bool, 3, Eigen::Dynamic> constrained_;
    CholmodFactor smooth_;
    double largest_ = 0;  // eigenvalue of K over its blocks
};

}  // namespace tissuewarp::tled::detail
