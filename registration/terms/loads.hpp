#pragma once
/// Loads of the tissue as forces on nodes.

#include "registration/options.hpp"
#include "registration/prepare.hpp"
#include "registration/terms/term.hpp"

namespace tissuewarp::registration::detail {

/// mN, 3 × N: the body force times the volume lumped to each node, and the pressure on the outer faces at rest. Throws
/// InvalidInput for loads that are not finite.
Eigen::Matrix3Xd nodal_forces(const PreparedModel& prepared, const TissueLoads& loads);

/// Loads stated, and those found in the course of a registration (State::found_loads).
class LoadTerm : public Term {
public:
    LoadTerm(const PreparedModel& prepared, const TissueLoads& stated);
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;

private:
    Eigen::Matrix3Xd stated_;  // mN, 3 × N
};

}  // namespace tissuewarp::registration::detail
