#include "registration/springs/label_springs.hpp"

namespace tissuewarp::registration::detail {

Eigen::Matrix3d spring_stiffness(const InterfaceNode& node, const Eigen::Vector3d& normal, double weight,
                                 const PrepareOptions& options) {
    const Eigen::Matrix3d along = normal * normal.transpose();
    return options.data_stiffness * node.area * weight *
           (along + options.tangential_ratio * (Eigen::Matrix3d::Identity() - along));
}

std::vector<tled::Spring> full_weight_springs(const Interfaces& interfaces, const PrepareOptions& options) {
    std::vector<tled::Spring> springs;
    for (const InterfaceNode& node : interfaces.nodes())
        springs.push_back({node.node, spring_stiffness(node, node.normal, 1.0, options), Eigen::Vector3d::Zero()});
    return springs;
}

std::vector<tled::Spring> matched_springs(const Interfaces& interfaces, const std::vector<Match>& matches,
                                          const Eigen::Matrix3Xd& normals, const Eigen::Matrix3Xd& displacement,
                                          const PrepareOptions& options) {
    std::vector<tled::Spring> springs;
    for (std::size_t i = 0; i < matches.size(); ++i) {
        const InterfaceNode& node = interfaces.nodes()[i];
        const Eigen::Vector3d normal = normals.col(static_cast<Eigen::Index>(i));
        const Eigen::Vector3d here = displacement.col(node.node);
        const Match& match = matches[i];
        if (!match.found) continue;
        const Eigen::Matrix3d pull = options.data_stiffness * node.area * match.weight * normal * normal.transpose();
        springs.push_back({node.node, pull, here + match.distance_mm * normal});
    }
    return springs;
}

std::vector<tled::Spring> holding_springs(const Interfaces& interfaces, const Eigen::Matrix3Xd& displacement,
                                          const PrepareOptions& options) {
    std::vector<tled::Spring> springs;
    for (const InterfaceNode& node : interfaces.nodes()) {
        const double stiffness = options.data_stiffness * node.area * options.tangential_ratio;
        springs.push_back({node.node, stiffness * Eigen::Matrix3d::Identity(), displacement.col(node.node)});
    }
    return springs;
}

}  // namespace tissuewarp::registration::detail
