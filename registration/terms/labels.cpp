#include "registration/terms/labels.hpp"

#include "registration/doubts.hpp"
#include "registration/pose/alignment.hpp"
#include "registration/terms/label_doubts.hpp"
#include "registration/terms/label_matches.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace tissuewarp::registration::detail {

namespace {

void require_common_labels(const LabelBoundaries& fixed, const PreparedModel& prepared) {
    for (const auto& [label, extent] : fixed.extents())
        if (prepared.model.materials.contains(label)) return;
    throw InvalidInput("the fixed label map holds none of the labels of the model; check the label tables");
}

double volume_of(const LabelBoundaries& map) {
    return labelled_volume(map.extents(), map.labels().geometry);
}

double largest_poisson_ratio(const tled::MaterialTable& materials) {
    double largest = 0;
    for (const auto& [label, material] : materials) largest = std::max(largest, tled::poisson_ratio(material));
    return largest;
}

}  // namespace

LabelTools::LabelTools(const PreparedModel& prepared)
    : moving(prepared.labels),
      neighbours(prepared.interfaces.neighbours()),
      thickness_mm(prepared.interfaces.thickness(prepared.model.mesh)) {}

LabelTerm::LabelTerm(const PreparedModel& prepared, std::shared_ptr<LabelTools> tools,
                     const imaging::Volume& fixed_labels, const UpdateOptions& options)
    : prepared_(prepared),
      tools_(std::move(tools)),
      fixed_(fixed_labels),
      options_(options),
      boundaries_(fixed_labels, fixed_.extents(), tools_->thickness_mm) {
    require_common_labels(fixed_, prepared);
}

Alignment LabelTerm::pose(const Eigen::Isometry3d& /*start*/, Observer& observer) {
    return align_labels(tools_->moving, fixed_, options_.alignment, observer);
}

Contribution LabelTerm::linearise(const RoundPlan& plan, const State& state, Observer& /*observer*/) {
    const Interfaces& interfaces = prepared_.interfaces;
    const Eigen::Matrix3Xd normals = interfaces.normals(prepared_.model.mesh.nodes + state.displacement);
    std::vector<Match> matches = match_interfaces(prepared_, boundaries_, fixed_.labels().geometry, state, normals,
                                                  plan, options_.max_angle_deg);
    leave_out_strays(matches, interfaces, tools_->neighbours, prepared_.model.mesh.nodes, state.displacement, normals);
    weigh(matches, tools_->neighbours, plan.scale_mm);
    bound(matches, plan.most_step_mm);
    last_ = {};
    last_.candidates = static_cast<int>(matches.size());
    last_.mean_residual_mm = mean_residual(matches);
    for (const Match& match : matches) {
        last_.matched += match.found;
        last_.held_back += match.held_back;
    }
    if (last_.matched == 0)
        throw InvalidInput("no boundary of the model was found in the fixed labels within " + to_text(plan.range_mm) +
                           " mm; " + why_nothing_matches(tools_->moving, fixed_));
    Contribution result = last_;
    result.springs = pulled_by(label_kind(prepared_.labels.geometry, fixed_.labels().geometry),
                               matched_springs(interfaces, matches, normals, state.displacement, prepared_.options));
    const auto holds = pulled_by(Origin::Hold, holding_springs(interfaces, state.displacement, prepared_.options));
    std::copy(holds.begin(), holds.end(), std::back_inserter(result.springs));
    return result;
}

void LabelTerm::judge(const State& /*state*/, UpdateResult& result) {
    constexpr LabelDoubtLimits limits = label_doubt_limits;
    const double most_residual = limits.most_residual_voxels * prepared_.labels.geometry.spacing.maxCoeff();
    if (last_.matched < limits.least_matched * last_.candidates)
        result.doubts.push_back({"labels.unmatched", last_.matched / double(last_.candidates), limits.least_matched,
                                 "only " + std::to_string(last_.matched) + " of " + std::to_string(last_.candidates) +
                                     " boundary nodes found their boundary in the fixed labels",
                                 "check that both label maps are of this organ, and its placement"});
    if (last_.mean_residual_mm > most_residual)
        result.doubts.push_back(
            {"labels.apart", last_.mean_residual_mm, most_residual,
             "the surfaces still differ by " + to_text(last_.mean_residual_mm) + " mm on average, more than a voxel",
             "look where the labels differ; allow more rounds, or softer tissue"});
    std::vector<Doubt> about_labels = doubts_of_labels(prepared_, tools_->moving, fixed_, options_, result);
    const bool cut = std::any_of(about_labels.begin(), about_labels.end(),
                                 [](const Doubt& doubt) { return doubt.code == "labels.cut_off"; });
    const double growth = volume_of(fixed_) / volume_of(tools_->moving);
    const double poisson = largest_poisson_ratio(prepared_.model.materials);
    if (std::abs(growth - 1) > limits.most_growth && poisson > limits.resisting_poisson)
        result.doubts.push_back({"labels.volume_changed", growth, limits.most_growth,
                                 "the labelled volume changed by the factor " + to_text(growth) +
                                     ", which tissue of Poisson's ratio " + to_text(poisson) + " resists",
                                 std::string(cut ? "part of it may be what the image cuts off; " : "") +
                                     "for lungs take --tissue lung, for other tissue that changes volume a ratio of "
                                     "0.3 or less"});
    for (Doubt& doubt : about_labels) result.doubts.push_back(std::move(doubt));
}

std::optional<Doubt> doubt_of_growth(const imaging::Volume& moving, const imaging::Volume& fixed, double most_growth) {
    const double growth = labelled_volume(imaging::label_extents(fixed), fixed.geometry) /
                          labelled_volume(imaging::label_extents(moving), moving.geometry);
    if (growth <= most_growth && growth >= 1 / most_growth) return std::nullopt;
    return Doubt{"labels.volume_changed", growth, growth > 1 ? most_growth : 1 / most_growth,
                 "the labelled volume changed by the factor " + to_text(growth) + ", more than such tissue can",
                 "check that both label maps show all of the organ"};
}

}  // namespace tissuewarp::registration::detail
