#include "registration/detail/expected_error.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

constexpr int places = 16;
/// Motions of the organ as a whole that no datum shows, such as one along a straight vessel, are known no worse: their
/// variance stays finite.
constexpr double least_known_mm = 100;

using Columns = Eigen::MatrixXd;  // 3N × k, nodes' vectors one after the other

Columns flat(const Eigen::Matrix3Xd& vectors) {
    return Eigen::Map<const Eigen::VectorXd>(vectors.data(), vectors.size());
}

/// Six fields, 3N × 6: shifts along and turns about the axes.
Columns rigid_motions(const Eigen::Matrix3Xd& nodes) {
    const Eigen::Matrix3Xd arms = nodes.colwise() - nodes.rowwise().mean();
    const double radius = std::sqrt(arms.colwise().squaredNorm().mean());
    Columns motions(nodes.size(), 6);
    for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis);
        Eigen::Matrix3Xd shift(3, nodes.cols()), turn(3, nodes.cols());
        shift.colwise() = unit;
        for (Eigen::Index n = 0; n < nodes.cols(); ++n) turn.col(n) = unit.cross(Eigen::Vector3d(arms.col(n))) / radius;
        motions.col(axis) = flat(shift);
        motions.col(axis + 3) = flat(turn);
    }
    return motions;
}

Columns times(const std::vector<tled::Spring>& springs, const Columns& vectors) {
    Columns result = Columns::Zero(vectors.rows(), vectors.cols());
    for (const tled::Spring& spring : springs)
        result.middleRows<3>(3 * spring.node) += spring.stiffness * vectors.middleRows<3>(3 * spring.node);
    return result;
}

/// Unit forces at nodes along the axes, 3N × 3 per node.
Columns unit_forces(const std::vector<int>& chosen, Eigen::Index rows) {
    Columns forces = Columns::Zero(rows, 3 * static_cast<Eigen::Index>(chosen.size()));
    for (Eigen::Index k = 0; k < forces.cols(); ++k) forces(3 * chosen[static_cast<std::size_t>(k / 3)] + k % 3, k) = 1;
    return forces;
}

/// Of a symmetric matrix whose eigenvalues are to be no smaller than `least`.
Eigen::MatrixXd bounded_inverse(const Eigen::MatrixXd& matrix, double least) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(matrix);
    return modes.eigenvectors() * modes.eigenvalues().cwiseMax(least).cwiseInverse().asDiagonal() *
           modes.eigenvectors().transpose();
}

std::vector<int> spread_nodes(const Eigen::Matrix3Xd& nodes) {
    std::vector<int> chosen;
    Eigen::RowVectorXd nearest = (nodes.colwise() - nodes.rowwise().mean()).colwise().squaredNorm();
    Eigen::Index node = 0;
    nearest.minCoeff(&node);
    nearest.setConstant(1e30);
    for (int n = 0; n < std::min<int>(places, static_cast<int>(nodes.cols())); ++n) {
        chosen.push_back(static_cast<int>(node));
        nearest = nearest.cwiseMin((nodes.colwise() - nodes.col(node)).colwise().squaredNorm());
        nearest.maxCoeff(&node);
    }
    return chosen;
}

}  // namespace

ExpectedError expected_error(const PreparedModel& prepared, const WeighedSprings& springs) {
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    tled::Conditions all;
    all.springs = springs.data;
    all.springs.insert(all.springs.end(), springs.ground.begin(), springs.ground.end());
    const tled::RestStiffness stiffness(prepared.rest, tled::nodal_conditions(all, static_cast<int>(nodes.cols())),
                                        prepared.stiffness);
    // (K − G R A⁻¹ Rᵀ G)⁻¹ = K⁻¹ + K⁻¹ H (A − Hᵀ K⁻¹ H)⁻¹ Hᵀ K⁻¹ with H = G R, A = Rᵀ G R (Woodbury).
    Columns freed = Columns::Zero(nodes.size(), 0);
    Eigen::MatrixXd middle;
    if (springs.free_placement) {
        const Columns motions = rigid_motions(nodes), held = times(springs.ground, motions);
        freed = stiffness.solve_columns(held);
        middle = bounded_inverse(motions.transpose() * held - held.transpose() * freed,
                                 springs.energy / (least_known_mm * least_known_mm));
    }
    ExpectedError result;
    double sum = 0;
    const std::vector<int> chosen = spread_nodes(nodes);
    const Columns answers = stiffness.solve_columns(unit_forces(chosen, nodes.size()));
    for (std::size_t place = 0; place < chosen.size(); ++place) {
        const int node = chosen[place];
        double variance = 0;
        for (int axis = 0; axis < 3; ++axis) {
            variance += springs.energy * answers(3 * node + axis, 3 * static_cast<Eigen::Index>(place) + axis);
            if (!springs.free_placement) continue;
            const Eigen::VectorXd share = freed.row(3 * node + axis).transpose();
            variance += springs.energy * share.dot(middle * share);
        }
        sum += variance;
        if (std::sqrt(variance) <= result.worst_mm) continue;
        result.worst_mm = std::sqrt(variance);
        result.worst_place = nodes.col(node);
    }
    result.mean_mm = std::sqrt(sum / double(chosen.size()));
    return result;
}

}  // namespace tissuewarp::registration::detail
