#include "registration/terms/cavity.hpp"

#include "registration/resection/find_resection.hpp"
#include "registration/resection/seen_cavity.hpp"

#include <limits>

namespace tissuewarp::registration::detail {

namespace {

constexpr int beside = 1;  // label of all that is not the cavity

imaging::Volume all_beside(const imaging::Volume& cavity) {
    return {cavity.geometry, cv::Mat((cavity.voxels == 0) / 255 * beside)};
}

}  // namespace

CavityTerm::CavityTerm(const PreparedModel& prepared, const imaging::Volume& fixed, const FieldOfView& view,
                       const UpdateOptions& options)
    : prepared_(prepared), fixed_(fixed), view_(view), options_(options), pull_(prepared, options) {}

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
    const std::vector<InterfaceNode>& nodes = prepared_.interfaces.nodes();
    const auto ahead = [&](std::size_t i, const Eigen::Vector3d& place, const Eigen::Vector3d& normal) {
        if (!nodes[i].at_cavity) return std::numeric_limits<double>::quiet_NaN();
        return wall_->crossing(place, normal, beside, 0, cavity_term_options.range_mm, options_.max_angle_deg) -
               nodes[i].offset;
    };
    const imaging::Geometry& grid = fixed_.geometry;
    add(result, pull_.towards(ahead, label_kind(grid, grid), plan, state));
    for (const InterfaceNode& node : nodes) result.candidates += node.at_cavity;
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
