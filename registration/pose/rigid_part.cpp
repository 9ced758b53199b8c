#include "registration/pose/rigid_part.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace tissuewarp::registration::detail {

Eigen::Isometry3d closest_motion(const Eigen::Matrix3Xd& x, const Eigen::Matrix3Xd& y, const Eigen::VectorXd& weights) {
    const Eigen::Vector3d from = x * weights / weights.sum(), to = y * weights / weights.sum();
    const Eigen::Matrix3d covariance = (y.colwise() - to) * weights.asDiagonal() * (x.colwise() - from).transpose();
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double handedness = (svd.matrixU() * svd.matrixV().transpose()).determinant();
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.linear() =
        svd.matrixU() * Eigen::Vector3d(1, 1, handedness < 0 ? -1 : 1).asDiagonal() * svd.matrixV().transpose();
    motion.translation() = to - motion.linear() * from;
    return motion;
}

Eigen::MatrixXd rigid_motions(const Eigen::Matrix3Xd& nodes) {
    const Eigen::Matrix3Xd arms = nodes.colwise() - nodes.rowwise().mean();
    const double radius = std::sqrt(arms.colwise().squaredNorm().mean());
    Eigen::MatrixXd motions(nodes.size(), 6);
    for (Eigen::Index n = 0; n < nodes.cols(); ++n)
        for (int axis = 0; axis < 3; ++axis) {
            const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis);
            motions.block<3, 1>(3 * n, axis) = unit;
            motions.block<3, 1>(3 * n, axis + 3) = unit.cross(Eigen::Vector3d(arms.col(n))) / radius;
        }
    return motions;
}

void give_rigid_part_to_placement(const Eigen::Matrix3Xd& nodes, const std::vector<tled::Spring>& weights,
                                  State& state) {
    if (weights.empty()) return;
    Eigen::VectorXd weight = Eigen::VectorXd::Zero(nodes.cols());
    for (const tled::Spring& spring : weights) weight[spring.node] += spring.stiffness.trace();
    const Eigen::Matrix3Xd moved = nodes + state.displacement;
    const Eigen::Isometry3d motion = closest_motion(nodes, moved, weight);
    state.placement = state.placement * motion;
    state.displacement = (motion.inverse() * moved) - nodes;
}

}  // namespace tissuewarp::registration::detail
