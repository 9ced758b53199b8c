#pragma once
/// Contact with rigid bodies that pushes and never pulls, as springs and multipliers: what Newton's method solves in a
/// round of the augmented Lagrangian (Simo and Laursen, Comput Struct 42 (1992) 97).

#include "tled/conditions.hpp"

#include <optional>
#include <vector>

namespace tissuewarp::tled::detail {

/// From a body's surface.
struct Gap {
    double distance = 0;                               ///< mm, negative inside
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< outward, unit; zero where the body is not known
};
Gap gap_to(const Obstacle& obstacle, const Eigen::Vector3d& place);

/// A node that may touch.
struct ContactNode {
    int node = -1;
    Eigen::Vector3d X = Eigen::Vector3d::Zero();  ///< at rest, mm
    double stiffness = 0;                         ///< mN/mm
};

/// That a node touches one of the obstacles.
struct Touch {
    std::size_t obstacle = 0;
    double push = 0;  ///< mm beyond the surface to which the spring pushes: its force at the surface over its stiffness
};

/// Every obstacle pushes every node with stiffness · max(0, push − distance) along its normal; push is 0 where the node
/// does not touch it.
class OneSidedContact {
public:
    /// A touch, or none, of each node. The arguments outlive this.
    OneSidedContact(const std::vector<Obstacle>& obstacles, const std::vector<ContactNode>& nodes,
                    const std::vector<std::optional<Touch>>& touches);

    /// On the nodes of tissue displaced by `u` (3 × N, mm), mN, 3 × N.
    [[nodiscard]] Eigen::Matrix3Xd force(const Eigen::Matrix3Xd& u) const;
    /// `conditions` with the springs that push at `u`, for the tangent there; not their force, nor the bodies'
    /// curvature.
    [[nodiscard]] NodalConditions stiffened(const NodalConditions& conditions, const Eigen::Matrix3Xd& u) const;

private:
    const std::vector<Obstacle>& obstacles_;
    const std::vector<ContactNode>& nodes_;
    const std::vector<std::optional<Touch>>& touches_;

    /// use(node, mm by which its spring is pressed, unit normal), of each obstacle that pushes it.
    template <class Use>
    void for_each_pushed(const Eigen::Matrix3Xd& u, const Use& use) const;
};

}  // namespace tissuewarp::tled::detail
