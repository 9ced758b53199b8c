#pragma once
/// Exact second derivative of the discrete energy, in blocks of 3 × 3 by nodes.

#include "tled/rest_state.hpp"

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include <vector>

namespace tissuewarp::tled::detail {

/// Symmetric matrix of 3 × 3 blocks by rows; columns ascend within a row.
struct BlockRows {
    std::vector<int> offset, column;
    std::vector<Eigen::Matrix3d> block;  ///< mN/mm
    [[nodiscard]] int rows() const { return static_cast<int>(offset.size()) - 1; }
    /// Block (i, i).
    [[nodiscard]] Eigen::Matrix3d& diagonal(int i);
    [[nodiscard]] const Eigen::Matrix3d& diagonal(int i) const;
};

/// Σ_a stiffness_a g_a g_aᵀ, row a with the nodes and vectors of g_a. Of a pressure node: those on which J_a depends
/// and ∂J_a/∂u, 1/mm.
struct RankOneRows {
    std::vector<int> offset, node;
    std::vector<Eigen::Vector3d> gradient;
    Eigen::VectorXd stiffness;  ///< V_a M_a U''(J_a), mN·mm, of a pressure node; may be negative far from rest
    std::vector<int> node_offset, node_entry;  ///< node → its entries in the rows, ascending
    std::vector<int> row;                      ///< row of every entry
    [[nodiscard]] int rows() const { return static_cast<int>(offset.size()) - 1; }
};

/// Fills node_offset, node_entry and row from the others.
void list_by_node(int node_count, RankOneRows& rows);

/// K = elements + products. The sum over pressure nodes couples nodes two edges apart, so that the product form is
/// several times smaller than the assembled matrix.
struct Stiffness {
    BlockRows elements;
    RankOneRows products;

    /// K x, 3 × N, the same numbers for any number of threads.
    [[nodiscard]] Eigen::Matrix3Xd multiply(const Eigen::Matrix3Xd& x) const;
    /// The 3 × 3 block of every node on the diagonal of K.
    [[nodiscard]] std::vector<Eigen::Matrix3d> diagonal_blocks() const;
};

/// ∂²E/∂u² at a displacement (3 × N mm). Throws SolverFailure where det F ≤ 0.
Stiffness stiffness(const RestState& rest, const Eigen::Matrix3Xd& displacement);

/// The same without what is negative in it, tetrahedron by tetrahedron: positive semidefinite, near K, and downhill
/// where K is not (Teran, Sifakis, Irving, Fedkiw, ACM SCA 2005).
Stiffness positive_stiffness(const RestState& rest, const Eigen::Matrix3Xd& displacement);

enum class Triangle { Lower, Full };

/// K with the products multiplied out: the block columns of node i hold the rows j ≥ i (Lower) or all (Full).
BlockRows assembled(const Stiffness& stiffness, Triangle triangle);

/// Scalar matrix of the degrees of freedom d = 3·node + component with index[d] ≥ 0, which must ascend with d.
/// `Lower` stores the lower triangle alone, as CHOLMOD reads it.
Eigen::SparseMatrix<double> scalar_matrix(const BlockRows& matrix, const std::vector<int>& index, Triangle triangle);

}  // namespace tissuewarp::tled::detail
