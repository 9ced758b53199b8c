#pragma once
/// Correspondences as springs: stiff along the normal, soft along the surface, so that tissue may slide.

#include "registration/prepare.hpp"
#include "tled/conditions.hpp"

namespace tissuewarp::registration::detail {

/// K = stiffness · area · weight · (n nᵀ + ratio (I − n nᵀ)), mN/mm.
Eigen::Matrix3d spring_stiffness(const InterfaceNode& node, const Eigen::Vector3d& normal, double weight,
                                 const PrepareOptions& options);

/// Springs of every interface node at weight one with target zero: what the factor of K₀ is made with.
std::vector<tled::Spring> full_weight_springs(const Interfaces& interfaces, const PrepareOptions& options);

/// Where one interface node is drawn to.
struct Match {
    bool found = false;
    bool held_back = false;  ///< the image's boundary lies further away than this round may pull
    double distance_mm = 0;  ///< along the normal, from the node's material boundary to the image's boundary
    double weight = 1;       ///< in [0, 1]
};

/// Springs from `displacement` (3 × N, moving frame) along `normals` (one column per interface node) to the matches.
std::vector<tled::Spring> matched_springs(const Interfaces& interfaces, const std::vector<Match>& matches,
                                          const Eigen::Matrix3Xd& normals, const Eigen::Matrix3Xd& displacement,
                                          const PrepareOptions& options);

/// Springs of tangential stiffness of every interface node to where it is, so that no piece of tissue floats and the
/// system stays definite where robust weights vanish. They slow the rounds down and say nothing of where tissue
/// belongs.
std::vector<tled::Spring> holding_springs(const Interfaces& interfaces, const Eigen::Matrix3Xd& displacement,
                                          const PrepareOptions& options);

}  // namespace tissuewarp::registration::detail
