#include "tled/stiffness/smooth_space.hpp"

#include "core/errors.hpp"
#include "tled/model/springs.hpp"
#include "tled/parallel/parallel_pair.hpp"

#include <algorithm>
#include <numeric>
#include <vector>

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::VectorXd;

namespace {

/// Where few nodes lie in a cell some motions of its corners move none of them: what holds those is next to nothing
/// beside tissue, and what they are changes no displacement.
constexpr double hold = 1e-9;

constexpr int most_cells = 100, nodes_of_cell = 100;

int cells_for(Eigen::Index nodes) {
    return static_cast<int>(std::clamp<Eigen::Index>(nodes / nodes_of_cell, 1, most_cells));
}

std::vector<int> all_unknowns(const BlockRows& K) {
    std::vector<int> index(3 * static_cast<std::size_t>(K.rows()));
    std::iota(index.begin(), index.end(), 0);
    return index;
}

/// Pᵀ B P of 3 × 3 blocks on the diagonal of nodes.
class NodeBlocks {
public:
    explicit NodeBlocks(const Lattice& lattice)
        : lattice_(lattice), of_cell_(lattice.cell_count(), Eigen::Matrix<double, 24, 24>::Zero()) {}

    void add(int node, const Matrix3d& block) {
        const auto& weight = lattice_.weight.col(node);
        Eigen::Matrix<double, 24, 24>& sum = of_cell_[lattice_.cell[node]];
        for (int a = 0; a < 8; ++a)
            for (int b = 0; b < 8; ++b) sum.block<3, 3>(3 * a, 3 * b) += weight[a] * weight[b] * block;
    }

    /// K holds all pairs of points of every cell.
    void add_to(BlockRows& K) const {
        for (int cell = 0; cell < lattice_.cell_count(); ++cell)
            for (int a = 0; a < 8; ++a)
                for (int b = 0; b < 8; ++b)
                    at(K, lattice_.corner(a, cell), lattice_.corner(b, cell)) +=
                        of_cell_[cell].block<3, 3>(3 * a, 3 * b);
    }

private:
    static Matrix3d& at(BlockRows& K, int row, int column) {
        const auto first = K.column.begin() + K.offset[row], last = K.column.begin() + K.offset[row + 1];
        return K.block[std::lower_bound(first, last, column) - K.column.begin()];
    }

    const Lattice& lattice_;
    std::vector<Eigen::Matrix<double, 24, 24>> of_cell_;
};

/// The lower triangle, with a hold.
Eigen::SparseMatrix<double> held_lower(BlockRows K) {
    for (int p = 0; p < K.rows(); ++p) {
        Matrix3d& block = K.diagonal(p);
        for (int c = 0; c < 3; ++c) block(c, c) = block(c, c) > 0 ? (1 + hold) * block(c, c) : 1.0;
    }
    return scalar_matrix(K, all_unknowns(K), Triangle::Lower);
}

CholmodFactor analysed(const Eigen::SparseMatrix<double>& lower) {
    std::vector<int> node_of(static_cast<std::size_t>(lower.rows()));
    for (std::size_t d = 0; d < node_of.size(); ++d) node_of[d] = static_cast<int>(d) / 3;
    return {lower, node_of};
}

CholmodFactor factorised(CholmodFactor factor, const Eigen::SparseMatrix<double>& lower) {
    if (!factor.factorize(lower))
        throw InvalidInput(
            "the stiffness at rest is not positive definite: springs and prescribed displacements hold the tissue too "
            "weakly; hold it at more nodes or with stiffer springs");
    return factor;
}

}  // namespace

CholmodFactor smooth_factor(BlockRows K) {
    const Eigen::SparseMatrix<double> lower = held_lower(std::move(K));
    return factorised(analysed(lower), lower);
}

SmoothSpace::SmoothSpace(const BlockRows& elastic, const Matrix3Xd& position,
                         const Eigen::Matrix<bool, 3, Eigen::Dynamic>& constrained)
    : lattice_(lattice_about(position, cells_for(position.cols()))),
      constrained_(constrained),
      elastic_(galerkin(lattice_, elastic)),
      analysis_(analysed(held_lower(elastic_))) {}

Matrix3Xd SmoothSpace::slowest(const NodalConditions& springs, const Matrix3Xd& D) const {
    constexpr int iterations = 10;
    const auto free = [&](int node, const Matrix3d& block) {
        const Eigen::Vector3d is_free = (!constrained_.col(node).array()).cast<double>();
        return Matrix3d(is_free.asDiagonal() * block * is_free.asDiagonal());
    };
    BlockRows K = elastic_, M = elastic_;
    NodeBlocks held(lattice_), mass(lattice_);
    parallel_pair(
        [&] {
            for (int s = 0; s < static_cast<int>(springs.spring_node.size()); ++s)
                held.add(springs.spring_node[s], free(springs.spring_node[s], spring_matrix(springs, s)));
        },
        [&] {
            for (int i = 0; i < static_cast<int>(D.cols()); ++i) mass.add(i, free(i, D.col(i).asDiagonal()));
        });
    held.add_to(K);
    std::fill(M.block.begin(), M.block.end(), Matrix3d::Zero());
    mass.add_to(M);

    const Eigen::SparseMatrix<double> lower = held_lower(std::move(K));
    const CholmodFactor factor = factorised(analysis_.analysis(), lower);
    const Eigen::SparseMatrix<double> D_smooth = scalar_matrix(M, all_unknowns(M), Triangle::Full);
    VectorXd x(D_smooth.cols());
    for (Eigen::Index i = 0; i < x.size(); ++i) x[i] = 1.0 + 0.5 * std::sin(0.7 * static_cast<double>(i));
    for (int k = 0; k < iterations; ++k) x = factor.solve(D_smooth * x.normalized());
    return constrained_.select(0.0, prolonged(lattice_, x).reshaped(3, D.cols()));
}

}  // namespace tissuewarp::tled::detail
