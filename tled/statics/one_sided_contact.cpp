#include "tled/statics/one_sided_contact.hpp"

namespace tissuewarp::tled::detail {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

Gap gap_to(const Obstacle& obstacle, const Vector3d& place) {
    const Distance d = distance_to(obstacle, place);
    const double steepness = d.gradient.norm();
    if (!(steepness > 0)) return {d.value, Vector3d::Zero()};
    return {d.value / steepness, d.gradient / steepness};
}

OneSidedContact::OneSidedContact(const std::vector<Obstacle>& obstacles, const std::vector<ContactNode>& nodes,
                                 const std::vector<std::optional<Touch>>& touches)
    : obstacles_(obstacles), nodes_(nodes), touches_(touches) {}

template <class Use>
void OneSidedContact::for_each_pushed(const Matrix3Xd& u, const Use& use) const {
    for (std::size_t i = 0; i < nodes_.size(); ++i)
        for (std::size_t o = 0; o < obstacles_.size(); ++o) {
            const Gap gap = gap_to(obstacles_[o], nodes_[i].X + u.col(nodes_[i].node));
            const double push = touches_[i] && touches_[i]->obstacle == o ? touches_[i]->push : 0;
            if (push > gap.distance) use(nodes_[i], push - gap.distance, gap.normal);
        }
}

Matrix3Xd OneSidedContact::force(const Matrix3Xd& u) const {
    Matrix3Xd result = Matrix3Xd::Zero(3, u.cols());
    for_each_pushed(u, [&](const ContactNode& at, double pressed_mm, const Vector3d& normal) {
        result.col(at.node) += at.stiffness * pressed_mm * normal;
    });
    return result;
}

NodalConditions OneSidedContact::stiffened(const NodalConditions& conditions, const Matrix3Xd& u) const {
    std::vector<Spring> springs;
    for_each_pushed(u, [&](const ContactNode& at, double, const Vector3d& normal) {
        springs.push_back({at.node, at.stiffness * normal * normal.transpose(), Vector3d::Zero()});
    });
    return with_springs(conditions, springs);
}

}  // namespace tissuewarp::tled::detail
