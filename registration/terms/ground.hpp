#pragma once
/// The prior where points alone show the organ.

#include "registration/prepare.hpp"
#include "registration/terms/term.hpp"

#include <vector>

namespace tissuewarp::registration::detail {

/// The prior where points alone show the organ: its surface lies about where the rigid placement has it. It moves with
/// the placement.
class GroundTerm : public Term {
public:
    /// `motion_mm` is the standard deviation of the surface's motion, any way.
    GroundTerm(const PreparedModel& prepared, double energy, double motion_mm);
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;

private:
    std::vector<PulledNode> springs_;
};

}  // namespace tissuewarp::registration::detail
