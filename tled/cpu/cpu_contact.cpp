#include "tled/cpu/cpu_contact.hpp"

#include <cmath>

namespace tissuewarp::tled::detail {

CpuContact::CpuContact(const NodalContact& contact, const std::vector<std::uint32_t>& internal)
    : node_(contact.node),
      obstacles_(contact.obstacles),
      reach_(contact.reach),
      position_(contact.rest_position),
      tangent_(contact.node.size() * contact.obstacles.size()) {
    for (std::size_t i = 0; i < contact.node.size(); ++i)
        point_.push_back({internal[static_cast<std::size_t>(contact.node[i])], static_cast<std::uint32_t>(i)});
    std::sort(point_.begin(), point_.end(), [](const Point& x, const Point& y) { return x.node < y.node; });
}

bool CpuContact::take(const NodalContact& contact) {
    const auto in_place = [](const Obstacle& now, const Obstacle& before) {
        return now.surface == before.surface && now.placement == before.placement;
    };
    if (node_ != contact.node ||
        !std::equal(contact.obstacles.begin(), contact.obstacles.end(), obstacles_.begin(), obstacles_.end(), in_place))
        return false;
    obstacles_ = contact.obstacles;
    return true;
}

void CpuContact::forget_looks() {
    std::fill(tangent_.begin(), tangent_.end(), Tangent{});
    for (Point& point : point_) point.free_squared = 0.0;
}

Tangent CpuContact::look(std::size_t obstacle, const Eigen::Vector3d& X, const Eigen::Vector3d& u) const {
    const Distance distance = distance_to(obstacles_[obstacle], X + u);
    const double steepness = distance.gradient.norm();
    // Outside of a grid it looks again at once: the border may lie inside the obstacle.
    if (!std::isfinite(distance.value)) return {u, Eigen::Vector3d::Zero(), distance.value, 0.0};
    if (!(steepness > 0)) return {u, Eigen::Vector3d::Zero(), std::max(distance.value, 0.0), 0.0};
    const double reach = std::max(distance.value / reach_[obstacle].steepness, reach_[obstacle].tangent);
    return {u, distance.gradient / steepness, distance.value / steepness, reach * reach};
}

}  // namespace tissuewarp::tled::detail
