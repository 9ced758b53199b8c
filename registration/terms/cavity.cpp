#include "registration/terms/cavity.hpp"

#include "registration/resection/find_resection.hpp"
#include "registration/resection/seen_cavity.hpp"
#include "registration/springs/label_springs.hpp"
#include "registration/terms/label_matches.hpp"

#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

constexpr int beside = 1;  // label of all that is not the cavity

imaging::Volume all_beside(const imaging::Volume& cavity) {
    return {cavity.geometry, cv::Mat((cavity.voxels == 0) / 255 * beside)};
}

}  // namespace

CavityTerm::CavityTerm(const PreparedModel& prepared, const imaging::Volume& fixed, const FieldOfView& view,
                       const UpdateOptions& options)
    : prepared_(prepared),
      fixed_(fixed),
      view_(view),
      options_(options),
      neighbours_(prepared.interfaces.neighbours()) {}

void CavityTerm::search(const State& state) {
    const std::optional<imaging::Volume> cavity =
        seen_cavity(prepared_, {prepared_.model.mesh, state.displacement, state.placement}, fixed_, view_);
    wall_.reset();
    if (cavity) wall_.emplace(all_beside(*cavity), std::map<int, double>{{beside, 3 * cavity_options.reach_mm}});
}

Contribution CavityTerm::linearise(const RoundPlan& plan, const State& state, Observer& /*observer*/) {
    Contribution result;
    if (plan.searches_due >= cavity_term_options.first_search && searches_ < plan.searches_due) {
        search(state);
        searches_ = plan.searches_due;
        result.pulls_anew = true;
    }
    if (!wall_) return result;
    const Interfaces& interfaces = prepared_.interfaces;
    const Eigen::Matrix3Xd& rest = prepared_.model.mesh.nodes;
    const Eigen::Matrix3Xd normals = interfaces.normals(rest + state.displacement);
    std::vector<Match> matches(interfaces.nodes().size());
    for (std::size_t i = 0; i < matches.size(); ++i) {
        const InterfaceNode& node = interfaces.nodes()[i];
        if (!node.at_cavity || std::isnan(node.offset)) continue;
        const Eigen::Vector3d place = rest.col(node.node) + state.displacement.col(node.node),
                              normal = state.placement.linear() * normals.col(static_cast<Eigen::Index>(i));
        const double crossing = wall_->crossing(state.placement * place, normal, beside, 0,
                                                cavity_term_options.range_mm, options_.max_angle_deg);
        if (std::isnan(crossing)) continue;
        matches[i].found = true;
        matches[i].distance_mm = crossing - node.offset;
        matches[i].held_back = std::abs(matches[i].distance_mm) > plan.most_step_mm;
    }
    leave_out_strays(matches, interfaces, neighbours_, rest, state.displacement, normals);
    weigh(matches, neighbours_, plan.scale_mm);
    bound(matches, plan.most_step_mm);
    result.mean_residual_mm = mean_residual(matches);
    for (std::size_t i = 0; i < matches.size(); ++i) {
        result.candidates += interfaces.nodes()[i].at_cavity;
        result.matched += matches[i].found;
        result.held_back += matches[i].held_back;
    }
    const imaging::Geometry& grid = fixed_.geometry;
    result.springs = pulled_by(label_kind(grid, grid),
                               matched_springs(interfaces, matches, normals, state.displacement, prepared_.options));
    return result;
}

void CavityTerm::judge(const State& /*state*/, UpdateResult& result) {
    if (wall_) return;
    result.doubts.push_back(
        {"resected.no_cavity", 0, cavity_options.least_core_ml,
         "the fixed image shows no cavity where tissue was resected, and nothing tells how its wall "
         "moved but the tissue behind it",
         "look where the hole lies, or give labels that leave the cavity out", Severity::Notice});
}

}  // namespace tissuewarp::registration::detail
