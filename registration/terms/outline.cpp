#include "registration/terms/outline.hpp"

#include "imaging/labels.hpp"
#include "registration/matching/descriptors/matching_image.hpp"
#include "registration/terms/cavity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

constexpr int something = 1;     // label of what an image shows
constexpr double thick_mm = 50;  // smoothed by a whole voxel

LabelBoundaryField edges_of(const imaging::Volume& shown) {
    return {imaging::mask_of_all(shown).as(CV_32S), std::map<int, double>{{something, thick_mm}}};
}

/// How far ahead of each interface node at rest the moving image ends.
std::vector<double> ends_ahead(const PreparedModel& prepared) {
    constexpr OffsetOptions options;
    const LabelBoundaryField edges = edges_of(SeenImage(prepared.image->image).seen);
    std::vector<double> ahead;
    for (const InterfaceNode& node : prepared.interfaces.nodes())
        ahead.push_back(node.outer == 0 && !node.at_cavity
                            ? edges.crossing(prepared.model.mesh.nodes.col(node.node), node.normal, something, 0,
                                             options.range_mm, options.max_angle_deg)
                            : std::numeric_limits<double>::quiet_NaN());
    return ahead;
}

}  // namespace

OutlineTerm::OutlineTerm(const PreparedModel& prepared, std::vector<double> before, const imaging::Volume& shown,
                         const UpdateOptions& options)
    : grid_(shown.geometry),
      max_angle_deg_(options.max_angle_deg),
      before_(std::move(before)),
      shown_(edges_of(shown)),
      pull_(prepared, options) {}

Contribution OutlineTerm::linearise(const RoundPlan& plan, const State& state, Observer& /*observer*/) {
    if (plan.searches_due < cavity_term_options.first_search) return {};
    const auto ahead = [&](std::size_t i, const Eigen::Vector3d& place, const Eigen::Vector3d& normal) {
        if (std::isnan(before_[i])) return before_[i];
        return shown_.crossing(place, normal, something, 0, outline_options.range_mm, max_angle_deg_) - before_[i];
    };
    Contribution result = pull_.towards(ahead, label_kind(grid_, grid_), plan, state);
    result.candidates =
        static_cast<int>(std::count_if(before_.begin(), before_.end(), [](double mm) { return !std::isnan(mm); }));
    return result;
}

std::unique_ptr<Term> outline_term(const PreparedModel& prepared, const imaging::Volume& shown,
                                   const UpdateOptions& options) {
    std::vector<double> before = ends_ahead(prepared);
    int outer = 0, ends = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
        const InterfaceNode& node = prepared.interfaces.nodes()[i];
        outer += node.outer == 0 && !node.at_cavity;
        ends += !std::isnan(before[i]);
    }
    if (ends < outline_options.least_alone * outer || ends == 0) return nullptr;
    return std::make_unique<OutlineTerm>(prepared, std::move(before), shown, options);
}

}  // namespace tissuewarp::registration::detail
