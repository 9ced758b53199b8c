#include "registration/terms/ground.hpp"

#include "registration/springs/ground_springs.hpp"

namespace tissuewarp::registration::detail {

GroundTerm::GroundTerm(const PreparedModel& prepared, double energy, double motion_mm)
    : springs_(pulled_by(Origin::Prior,
                         ground_springs(prepared, energy, [&](const InterfaceNode&) { return motion_mm; }))) {}

Contribution GroundTerm::linearise(const RoundPlan& /*plan*/, const State& /*state*/, Observer& /*observer*/) {
    return {springs_};
}

}  // namespace tissuewarp::registration::detail
