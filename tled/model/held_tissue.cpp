#include "tled/model/held_tissue.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

#include "core/errors.hpp"
#include "tled/model/springs.hpp"
#include "tled/parallel/parallel.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Nodes connected with `seed` by elements. `visited` marks them.
std::vector<int> connected_nodes(const RestState& rest, int seed, std::vector<bool>& visited) {
    std::vector<int> piece{seed};
    visited[seed] = true;
    const auto add = [&](int node) {
        if (!visited[node]) piece.push_back(node);
        visited[node] = true;
    };
    const Incidence& incidence = rest.incidence;
    for (std::size_t next = 0; next < piece.size(); ++next) {
        const int node = piece[next];
        for (int k = incidence.offset[node]; k < incidence.offset[node + 1]; ++k) {
            for (int other : rest.nodes.col(incidence.entry[k] / 4)) add(other);
        }
    }
    return piece;
}

// Rᵀ K R of what holds the piece, for R the three translations and three rotations (scaled by the piece's radius) about
// its centre. Springs count by the ratio to the stiffest one, prescribed components as one.
Matrix6d rigid_resistance(const RestState& rest, const std::vector<int>& piece, const NodalConditions& conditions,
                          const std::vector<int>& spring_of, double spring_scale) {
    Vector3d centre = Vector3d::Zero();
    for (const int node : piece) centre += rest.position.col(node) / static_cast<double>(piece.size());
    double radius = 0.0;
    for (const int node : piece) radius = std::max(radius, (rest.position.col(node) - centre).norm());

    const auto of_node = [&](int node, Matrix6d& resistance) {
        Matrix3d hold = conditions.constrained.col(node).cast<double>().asDiagonal();
        if (spring_of[node] >= 0) {
            hold += spring_matrix(conditions, spring_of[node]) / spring_scale;
        }
        if (hold.isZero(0.0)) return;
        const Vector3d x = radius > 0.0 ? Vector3d((rest.position.col(node) - centre) / radius) : Vector3d::Zero();
        Eigen::Matrix<double, 3, 6> motion;
        motion << Matrix3d::Identity(), Matrix3d{{0, x[2], -x[1]}, {-x[2], 0, x[0]}, {x[1], -x[0], 0}};
        resistance += motion.transpose() * hold * motion;
    };
    constexpr std::size_t some = 256;  // nodes of a sum: the same for any number of threads
    std::vector<Matrix6d> sums((piece.size() + some - 1) / some, Matrix6d::Zero());
    parallel_ranges(0, sums.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n)
            for (std::size_t k = n * some; k < std::min(piece.size(), (n + 1) * some); ++k) of_node(piece[k], sums[n]);
    });
    return std::accumulate(sums.begin(), sums.end(), Matrix6d(Matrix6d::Zero()));
}

}  // namespace

std::vector<std::vector<int>> connected_pieces(const RestState& rest) {
    std::vector<std::vector<int>> pieces;
    std::vector<bool> visited(rest.node_count, false);
    for (int seed = 0; seed < rest.node_count; ++seed)
        if (!visited[seed]) pieces.push_back(connected_nodes(rest, seed, visited));
    return pieces;
}

void require_held(const RestState& rest, const NodalConditions& conditions) {
    require_held(rest, connected_pieces(rest), conditions);
}

void require_held(const RestState& rest, const std::vector<std::vector<int>>& pieces,
                  const NodalConditions& conditions) {
    constexpr double rigid = 1e-9;  // of the strongest resistance: a motion below it makes the factor useless
    std::vector<int> spring_of(rest.node_count, -1);
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s) {
        spring_of[conditions.spring_node[s]] = static_cast<int>(s);
    }
    const double largest =
        conditions.spring_stiffness.size() > 0 ? conditions.spring_stiffness.cwiseAbs().maxCoeff() : 0;
    for (const std::vector<int>& piece : pieces) {
        const int seed = piece.front();
        if (piece.size() == 1 && conditions.constrained.col(seed).all()) continue;
        const auto resistance = rigid_resistance(rest, piece, conditions, spring_of, largest > 0 ? largest : 1.0);
        const Eigen::SelfAdjointEigenSolver<Matrix6d> modes(resistance, Eigen::EigenvaluesOnly);
        if (modes.eigenvalues()[0] > rigid * modes.eigenvalues()[5]) continue;
        const int free = static_cast<int>((modes.eigenvalues().array() <= rigid * modes.eigenvalues()[5]).count());
        throw InvalidInput(
            "nothing holds the tissue: the piece of " + std::to_string(piece.size()) +
            " connected nodes that holds node " + std::to_string(seed) + " can still move in " + std::to_string(free) +
            " of 6 rigid motions; add springs or prescribed displacements on at least three of its nodes, "
            "not on one line");
    }
}

}  // namespace tissuewarp::tled::detail
