#pragma once
/// Smooth displacements of a mesh: trilinear between the points of a lattice of cubes about its nodes.

#include "tled/stiffness/stiffness.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::tled::detail {

/// Cells and points that no node is near are left out; cells are numbered in the order of their nodes.
struct Lattice {
    double edge_mm = 0;
    int point_count = 0;
    Eigen::Matrix<int, 8, Eigen::Dynamic> corner;     ///< points of every cell
    std::vector<int> cell;                            ///< of every node
    Eigen::Matrix<double, 8, Eigen::Dynamic> weight;  ///< of every node at the corners of its cell; they add up to 1
    std::vector<int> offset, node;                    ///< cell → its nodes, ascending

    [[nodiscard]] int cell_count() const { return static_cast<int>(corner.cols()); }
};

/// About `cells` cells that hold nodes (3 × N, mm).
Lattice lattice_about(const Eigen::Matrix3Xd& nodes, int cells);

/// P: displacements of the points to those of the nodes, 3L × k → 3N × k, vectors one after the other.
Eigen::MatrixXd prolonged(const Lattice& lattice, const Eigen::MatrixXd& of_points);
/// Pᵀ: forces on the nodes to those on the points, 3N × k → 3L × k.
Eigen::MatrixXd restricted(const Lattice& lattice, const Eigen::MatrixXd& of_nodes);

/// Pᵀ K P of a symmetric K with all its rows.
BlockRows galerkin(const Lattice& lattice, const BlockRows& K);

}  // namespace tissuewarp::tled::detail
