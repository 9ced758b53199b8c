#include "registration/terms/labels.hpp"

#include "registration/terms/label_matches.hpp"
#include "registration/uncertainty/doubts.hpp"

namespace tissuewarp::registration::detail {

LabelEvidence::LabelEvidence(const PreparedModel& prepared, const imaging::Volume& fixed_labels,
                             const UpdateOptions& options)
    : prepared_(prepared),
      options_(options),
      fixed_(fixed_labels, prepared.interfaces.thickness(prepared.model.mesh)),
      neighbours_(prepared.interfaces.neighbours()) {}

Contribution LabelEvidence::contribution(const RoundPlan& plan, const State& state) const {
    const Interfaces& interfaces = prepared_.interfaces;
    const Eigen::Matrix3Xd normals = interfaces.normals(prepared_.model.mesh.nodes + state.displacement);
    std::vector<Match> matches = match_interfaces(prepared_, fixed_, state, normals, plan, options_.max_angle_deg);
    leave_out_strays(matches, interfaces, neighbours_, prepared_.model.mesh.nodes, state.displacement, normals);
    weigh(matches, neighbours_, plan.scale_mm);
    bound(matches, plan.most_step_mm);
    Contribution result{matched_springs(interfaces, matches, normals, state.displacement, prepared_.options),
                        holding_springs(interfaces, state.displacement, prepared_.options),
                        static_cast<int>(matches.size()),
                        0,
                        0,
                        mean_residual(matches)};
    for (const Match& match : matches) {
        result.matched += match.found;
        result.held_back += match.held_back;
    }
    if (result.matched == 0)
        throw InvalidInput("no boundary of the model was found in the fixed labels within " + to_text(plan.range_mm) +
                           " mm; check that the images show the same organ");
    return result;
}

}  // namespace tissuewarp::registration::detail
