#pragma once
/// Sparse Cholesky factorisation: CHOLMOD (Chen, Davis, Hager, Rajamanickam 2008) behind RAII.

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include <memory>
#include <vector>

namespace tissuewarp::tled::detail {

/// Supernodal L Lᵀ of a symmetric positive definite matrix given by its lower triangle. The symbolic analysis is kept
/// over factorisations of one pattern.
class CholmodFactor {
public:
    /// Orders and analyses. The degrees of freedom of a node share all their neighbours, so the graph of the nodes is
    /// ordered and the permutation expanded: `node_of[d]` is the node of degree of freedom d, ascending.
    CholmodFactor(const Eigen::SparseMatrix<double>& lower, const std::vector<int>& node_of);
    ~CholmodFactor();
    CholmodFactor(CholmodFactor&&) noexcept;
    CholmodFactor& operator=(CholmodFactor&&) noexcept;

    /// The same analysis for another matrix of the pattern, not factorised yet.
    [[nodiscard]] CholmodFactor analysis() const;

    /// False when the matrix is not positive definite. The pattern must be the one analysed.
    [[nodiscard]] bool factorize(const Eigen::SparseMatrix<double>& lower);

    /// x with A x = b. Precondition: the last factorize() returned true. Uses workspaces: one thread at a time.
    [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& b) const;
    /// The same for every column at once: the factor is read once for all.
    [[nodiscard]] Eigen::MatrixXd solve_columns(const Eigen::MatrixXd& b) const;

    /// Rows and columns of A⁻¹ that belong to some unknowns. Of few that lie together it takes a small part of as many
    /// solves: only columns of L that these unknowns reach are read (Gilbert and Peierls 1988), and none twice.
    [[nodiscard]] Eigen::MatrixXd inverse_between(const std::vector<int>& unknowns) const;

    /// About how many solves with one vector take as long as a factorisation.
    [[nodiscard]] double solves_per_factor() const;

    /// Entries of L.
    [[nodiscard]] long long nonzeros() const;

private:
    struct Impl;
    explicit CholmodFactor(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace tissuewarp::tled::detail
