#include "registration/terms/boundary_pull.hpp"

#include "registration/springs/label_springs.hpp"
#include "registration/terms/label_matches.hpp"

#include <cmath>

namespace tissuewarp::registration::detail {

BoundaryPull::BoundaryPull(const PreparedModel& prepared, const UpdateOptions& options)
    : prepared_(prepared), options_(options), neighbours_(prepared.interfaces.neighbours()) {}

Contribution BoundaryPull::towards(const Ahead& ahead_mm, const DatumKind& kind, const RoundPlan& plan,
                                   const State& state) const {
    const Interfaces& interfaces = prepared_.interfaces;
    const Eigen::Matrix3Xd& rest = prepared_.model.mesh.nodes;
    const Eigen::Matrix3Xd normals = interfaces.normals(rest + state.displacement);
    std::vector<Match> matches(interfaces.nodes().size());
    for (std::size_t i = 0; i < matches.size(); ++i) {
        const int node = interfaces.nodes()[i].node;
        const double ahead = ahead_mm(i, state.placement * (rest.col(node) + state.displacement.col(node)),
                                      state.placement.linear() * normals.col(static_cast<Eigen::Index>(i)));
        if (std::isnan(ahead)) continue;
        matches[i].found = true;
        matches[i].distance_mm = ahead;
        matches[i].held_back = std::abs(ahead) > plan.most_step_mm;
    }
    leave_out_strays(matches, interfaces, neighbours_, rest, state.displacement, normals);
    weigh(matches, neighbours_, plan.scale_mm);
    bound(matches, plan.most_step_mm);
    Contribution result;
    result.mean_residual_mm = mean_residual(matches);
    for (const Match& match : matches) {
        result.matched += match.found;
        result.held_back += match.held_back;
    }
    result.springs =
        pulled_by(kind, matched_springs(interfaces, matches, normals, state.displacement, prepared_.options));
    return result;
}

}  // namespace tissuewarp::registration::detail
