#include "tled/detail/held_tissue.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <string>
#include <vector>

#include "core/errors.hpp"
#include "tled/detail/springs.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

// X_k − X_0 in the columns: the inverse of the gradients ∂N_k/∂X_j (row k).
Matrix3d rest_edges(const RestState& rest, int element) {
    const Matrix3d gradient = rest.gradient.col(element).reshaped(3, 3).transpose();
    return gradient.inverse();
}

// Nodes connected with `seed` by tetrahedra, with rest positions relative to it. `visited` marks them.
struct Piece {
    std::vector<int> nodes;
    std::vector<Vector3d> positions;  // mm
};

Piece connected_piece(const RestState& rest, int seed, std::vector<bool>& visited) {
    Piece piece{{seed}, {Vector3d::Zero()}};
    visited[seed] = true;
    for (std::size_t next = 0; next < piece.nodes.size(); ++next) {
        const int node = piece.nodes[next];
        for (int k = rest.incidence.offset[node]; k < rest.incidence.offset[node + 1]; ++k) {
            const int e = rest.incidence.entry[k] / 4, corner = rest.incidence.entry[k] % 4;
            if (visited[rest.nodes(0, e)] && visited[rest.nodes(1, e)] && visited[rest.nodes(2, e)] &&
                visited[rest.nodes(3, e)]) {
                continue;
            }
            const Matrix3d edges = rest_edges(rest, e);
            const auto local = [&](int c) -> Vector3d {
                return c == 0 ? Vector3d::Zero() : Vector3d(edges.col(c - 1));
            };
            for (int c = 0; c < 4; ++c) {
                const int other = rest.nodes(c, e);
                if (visited[other]) continue;
                visited[other] = true;
                piece.nodes.push_back(other);
                piece.positions.push_back(piece.positions[next] + local(c) - local(corner));
            }
        }
    }
    return piece;
}

// Rᵀ K R of what holds the piece, for R the three translations and three rotations (scaled by the piece's radius) about
// its centre. Springs count by the ratio to the stiffest one, prescribed components as one.
Eigen::Matrix<double, 6, 6> rigid_resistance(const Piece& piece, const NodalConditions& conditions,
                                             const std::vector<int>& spring_of, double spring_scale) {
    Vector3d centre = Vector3d::Zero();
    for (const Vector3d& x : piece.positions) centre += x / static_cast<double>(piece.positions.size());
    double radius = 0.0;
    for (const Vector3d& x : piece.positions) radius = std::max(radius, (x - centre).norm());

    Eigen::Matrix<double, 6, 6> resistance = Eigen::Matrix<double, 6, 6>::Zero();
    for (std::size_t n = 0; n < piece.nodes.size(); ++n) {
        const int node = piece.nodes[n];
        Matrix3d hold = conditions.constrained.col(node).cast<double>().asDiagonal();
        if (spring_of[node] >= 0) {
            hold += spring_matrix(conditions, spring_of[node]) / spring_scale;
        }
        if (hold.isZero(0.0)) continue;
        const Vector3d x = radius > 0.0 ? Vector3d((piece.positions[n] - centre) / radius) : Vector3d::Zero();
        Eigen::Matrix<double, 3, 6> motion;
        motion << Matrix3d::Identity(), Matrix3d{{0, x[2], -x[1]}, {-x[2], 0, x[0]}, {x[1], -x[0], 0}};
        resistance += motion.transpose() * hold * motion;
    }
    return resistance;
}

}  // namespace

void require_held(const RestState& rest, const NodalConditions& conditions) {
    constexpr double rigid = 1e-9;  // of the strongest resistance: a motion below it makes the factor useless
    std::vector<int> spring_of(rest.node_count, -1);
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s) {
        spring_of[conditions.spring_node[s]] = static_cast<int>(s);
    }
    const double largest =
        conditions.spring_stiffness.size() > 0 ? conditions.spring_stiffness.cwiseAbs().maxCoeff() : 0;
    std::vector<bool> visited(rest.node_count, false);
    for (int seed = 0; seed < rest.node_count; ++seed) {
        if (visited[seed]) continue;
        const Piece piece = connected_piece(rest, seed, visited);
        if (piece.nodes.size() == 1 && conditions.constrained.col(seed).all()) continue;
        const auto resistance = rigid_resistance(piece, conditions, spring_of, largest > 0 ? largest : 1.0);
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> modes(resistance, Eigen::EigenvaluesOnly);
        if (modes.eigenvalues()[0] > rigid * modes.eigenvalues()[5]) continue;
        const int free = static_cast<int>((modes.eigenvalues().array() <= rigid * modes.eigenvalues()[5]).count());
        throw InvalidInput(
            "nothing holds the tissue: the piece of " + std::to_string(piece.nodes.size()) +
            " connected nodes that holds node " + std::to_string(seed) + " can still move in " + std::to_string(free) +
            " of 6 rigid motions; add springs or prescribed displacements on at least three of its nodes, "
            "not on one line");
    }
}

}  // namespace tissuewarp::tled::detail
