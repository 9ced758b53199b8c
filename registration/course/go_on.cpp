#include "registration/course/go_on.hpp"

#include "registration/doubts.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

double root_mean_square(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to) {
    return std::sqrt((to - from).colwise().squaredNorm().mean());
}

bool grew(const AmountSeen& from, const AmountSeen& to, double most) {
    return to.surface > most * from.surface || to.pairs > most * from.pairs ||
           to.curve_points > most * from.curve_points;
}

/// The code of a severe doubt that only the newer result has.
std::optional<std::string> new_doubt(const UpdateResult& last, const UpdateResult& now) {
    for (const Doubt& doubt : now.doubts) {
        const auto same = [&](const Doubt& other) {
            return other.code == doubt.code && other.severity == Severity::Doubt;
        };
        if (doubt.severity == Severity::Doubt && std::none_of(last.doubts.begin(), last.doubts.end(), same))
            return doubt.code;
    }
    return std::nullopt;
}

}  // namespace

AmountSeen amount_seen(const UpdateResult& result) {
    return {result.surface ? result.surface->coverage : 0, result.points ? result.points->used : 0,
            result.curves ? result.curves->points : 0};
}

bool same_kinds(const UpdateResult& last, const Intraoperative& seen) {
    const bool had_labels = !last.pulls.of(Origin::Hold).empty();
    const std::size_t images = seen.image ? 1 + seen.contrasts.size() : 0;
    return had_labels == seen.labels.has_value() && last.images.size() == images &&
           last.surface.has_value() == seen.surface.has_value() && last.points.has_value() == seen.points.has_value() &&
           last.curves.has_value() == seen.curves.has_value();
}

UpdateOptions short_course(UpdateOptions options) {
    options.rematches = std::min(options.rematches, go_on_course.rounds);
    options.first_range_mm = options.last_range_mm;
    std::vector<int>& grids = options.image.dense_coarsening;
    if (!grids.empty()) grids = {grids.back()};
    return options;
}

std::optional<std::string> why_begin_anew(const UpdateResult& last, const UpdateResult& now, const GoOnLimits& limits) {
    const CarriedOn& carried = *last.carried_on;
    if (grew(carried.seen, amount_seen(now), limits.most_growth))
        return "much more is seen than when the placement was sought";
    const Eigen::Matrix3Xd nodes = now.deformation.deformed_nodes();
    const double step = root_mean_square(last.deformation.deformed_nodes(), nodes),
                 motion = root_mean_square(carried.nodes, nodes);
    if (step > limits.most_step_mm) return "tissue has moved by " + to_text(step) + " mm";
    if (motion > limits.most_motion_mm)
        return "tissue has moved by " + to_text(motion) + " mm since the placement was sought";
    const double before = last.rounds.back().mean_residual_mm, after = now.rounds.back().mean_residual_mm;
    if (after > limits.most_residual * before + limits.residual_slack_mm)
        return "the data fit by " + to_text(after) + " mm instead of " + to_text(before);
    if (const auto code = new_doubt(last, now)) return "it is doubted: " + *code;
    return std::nullopt;
}

}  // namespace tissuewarp::registration::detail
