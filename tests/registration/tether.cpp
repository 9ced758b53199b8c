#include "tests/registration/tether.hpp"

#include "registration/springs/pull.hpp"

namespace tissuewarp::registration::test {

TetherTerm::TetherTerm(const PreparedModel& prepared, const Eigen::Vector3d& moving, const Eigen::Vector3d& fixed,
                       double stiffness)
    : prepared_(prepared),
      moving_(moving),
      fixed_(fixed),
      stiffness_(stiffness),
      at_(detail::locate_near(meshing::PointLocator(prepared.model.mesh), moving).value()) {}

Alignment TetherTerm::pose(const Eigen::Isometry3d& start, Observer& /*observer*/) {
    return {Eigen::Translation3d(fixed_ - moving_) * start, 0};
}

detail::Contribution TetherTerm::linearise(const detail::RoundPlan& /*plan*/, const detail::State& state,
                                           Observer& /*observer*/) {
    const detail::Pull pull{at_, state.placement.inverse() * fixed_ - moving_,
                            stiffness_ * Eigen::Matrix3d::Identity()};
    detail::Contribution result;
    result.springs =
        detail::pulled_by(Origin::Datum, detail::lumped_springs(prepared_.model.mesh, {pull}, state.displacement));
    result.candidates = result.matched = 1;
    return result;
}

void TetherTerm::judge(const detail::State& state, UpdateResult& result) {
    const Eigen::Vector3d now =
        state.placement *
        Eigen::Vector3d(moving_ + detail::displacement_at(prepared_.model.mesh, state.displacement, at_));
    const double left = (now - fixed_).norm();
    if (left > 1) result.doubts.push_back({"tether.loose", left, 1, "the tether is loose"});
}

}  // namespace tissuewarp::registration::test
