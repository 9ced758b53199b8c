#include "registration/terms/curves.hpp"

#include "meshing/search/point_tree.hpp"
#include "registration/doubts.hpp"
#include "registration/io/curves.hpp"
#include "registration/pose/curve_pose.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

constexpr Eigen::Index most_points = curve_sampling.most_points;
constexpr int chord_reach = curve_sampling.chord_reach;

/// Every k-th, so that no more than `most_points` are left.
std::vector<Eigen::Index> thinned(Eigen::Index count) {
    const Eigen::Index stride = (count + most_points - 1) / most_points;
    std::vector<Eigen::Index> kept;
    for (Eigen::Index n = 0; n < count; n += stride) kept.push_back(n);
    return kept;
}

/// One over the number of points within half a piece, themselves included.
Eigen::VectorXd shares(const Eigen::Matrix3Xd& points, double piece_mm) {
    const meshing::PointTree tree(points);
    Eigen::VectorXd result(points.cols());
    for (Eigen::Index n = 0; n < points.cols(); ++n) result[n] = 1.0 / tree.count_within(points.col(n), piece_mm / 2);
    return result;
}

CurvePoints made_ready(const Curves& curves, const CurveOptions& options) {
    require_usable(curves);
    const std::vector<Eigen::Index> kept = thinned(curves.fixed.cols());
    CurvePoints data;
    data.points = curves.fixed(Eigen::all, kept);
    data.tangents = Eigen::Matrix3Xd::Zero(3, data.count());
    if (curves.tangents.cols() > 0) data.tangents = curves.tangents(Eigen::all, kept);
    data.shares = shares(data.points, options.piece_mm);
    data.deviation_mm = curves.deviation_mm;
    return data;
}

}  // namespace

/// Across a line an unbiased point lies √2 deviations off in root mean square.
std::vector<Doubt> doubts_of(const CurveFit& fit, double deviation_mm) {
    std::vector<Doubt> doubts;
    const auto& [least_inliers, most_residual] = curve_doubt_limits;
    if (fit.inlier_share < least_inliers)
        doubts.push_back({"curves.outliers", fit.inlier_share, least_inliers,
                          "only " + percent(fit.inlier_share) +
                              " of the intraoperative points along vessels came near a preoperative curve",
                          "check that both show the same vessels, and that the headers place the images within a "
                          "centimetre or two"});
    else if (fit.residual_mm > most_residual * deviation_mm)
        doubts.push_back({"curves.apart", fit.residual_mm, most_residual * deviation_mm,
                          "points along vessels lie " + to_text(fit.residual_mm) + " mm across from the curves where " +
                              to_text(deviation_mm) + " mm along each axis were stated",
                          "state how far off the points are (--curves-sd), or check that they show these vessels"});
    if (fit.rival_support > rival_pose_options.alike)
        doubts.push_back({"curves.two_poses", fit.rival_support, rival_pose_options.alike,
                          "the points along vessels fit about as well with the organ placed " + to_text(fit.rival_mm) +
                              " mm elsewhere",
                          "show more of the vessels, or give landmarks"});
    return doubts;
}

CurveTerm::CurveTerm(const PreparedModel& prepared, const Curves& curves, const CurveOptions& options, double energy)
    : prepared_(prepared), options_(options), energy_(energy), data_(made_ready(curves, options)) {
    take_lines(curves.moving);
}

void CurveTerm::take_lines(const std::vector<Eigen::Matrix3Xd>& lines) {
    const meshing::PointLocator locator(prepared_.model.mesh);
    std::vector<Eigen::Vector3d> samples;
    for (const Eigen::Matrix3Xd& line : lines) {
        int first = static_cast<int>(samples.size());
        const Eigen::Matrix3Xd places = evenly_along(line, options_.step_mm);
        for (const auto& place : places.colwise()) {
            if (const auto at = locate_near(locator, place)) {
                samples.emplace_back(place);
                places_.push_back(*at);
                continue;
            }
            join_samples(first, static_cast<int>(samples.size()));
            first = static_cast<int>(samples.size());
        }
        join_samples(first, static_cast<int>(samples.size()));
    }
    if (segments_.empty())
        throw InvalidInput("none of the " + std::to_string(lines.size()) +
                           " moving curves to register to lies in the model; coordinates must be LPS mm of the moving "
                           "image: for RAS, negate x and y");
    samples_.resize(3, static_cast<Eigen::Index>(samples.size()));
    for (std::size_t s = 0; s < samples.size(); ++s) samples_.col(static_cast<Eigen::Index>(s)) = samples[s];
}

/// Segments of the run of samples from `first` to before `last`.
void CurveTerm::join_samples(int first, int last) {
    for (int n = first; n + 1 < last; ++n)
        segments_.push_back({{n, n + 1}, {std::max(first, n - chord_reach), std::min(last - 1, n + 1 + chord_reach)}});
}

meshing::CurveTree CurveTerm::deformed_lines(const State& state) const {
    Eigen::Matrix3Xd places = samples_;
    for (std::size_t s = 0; s < places_.size(); ++s)
        places.col(static_cast<Eigen::Index>(s)) +=
            displacement_at(prepared_.model.mesh, state.displacement, places_[s]);
    return {std::move(places), segments_};
}

std::vector<CurveMatch> CurveTerm::matches(const State& state, double reach_mm) const {
    return match_curves(deformed_lines(state), data_, state.placement, reach_mm, options_.max_angle_deg);
}

Alignment CurveTerm::pose(const Eigen::Isometry3d& start, Observer& observer) {
    const double scale_mm = curve_pose_options.bending_mm + final_scale_mm();
    const ChosenPose found = search_curve_pose({samples_, segments_}, data_, start, scale_mm, options_.max_angle_deg);
    tell_what_headers_decide(found, "the points along vessels", observer);
    rival_mm_ = found.rival_mm;
    rival_support_ = found.rival_support();
    return {found.chosen.placement, found.chosen.typical_distance_mm(scale_mm)};
}

bool CurveTerm::take_over(const UpdateResult& last) {
    if (!last.curves) return false;
    rival_mm_ = last.curves->rival_mm;
    rival_support_ = last.curves->rival_support;
    return true;
}

/// A place (1 − α) a + α b on a segment moves with both ends: K (1 − α) at a and K α at b, each drawn by the same way,
/// have its force, and a stiffness not below its (Jensen's inequality, as in lumped_springs).
void CurveTerm::add_pulls(const CurveMatch& match, double stiffness, const State& state, double most_step_mm,
                          std::vector<Pull>& pulls) const {
    const Eigen::Vector3d& tangent = match.hit.tangent;
    const Eigen::Matrix3d across = stiffness * (Eigen::Matrix3d::Identity() - tangent * tangent.transpose());
    const double step = std::min(1.0, most_step_mm / std::max(match.across.norm(), 1e-9));
    const meshing::Segment& segment = segments_[static_cast<std::size_t>(match.hit.segment)];
    const std::array<double, 2> parts{1 - match.hit.along, match.hit.along};
    for (std::size_t end = 0; end < 2; ++end) {
        if (parts[end] <= 0) continue;
        const meshing::Location& at = places_[static_cast<std::size_t>(segment.ends[end])];
        const Eigen::Vector3d now = displacement_at(prepared_.model.mesh, state.displacement, at);
        pulls.push_back({at, now + step * match.across, parts[end] * across});
    }
}

/// No match counts as held back by the step bound, for which the round would be repeated: among few points outliers
/// alone would repeat it for ever. The inlier share says in the end what was not reached.
Contribution CurveTerm::linearise(const RoundPlan& plan, const State& state, Observer& /*observer*/) {
    const double reach =
        std::max(robust_rounds.reach_of_scale * final_scale_mm(), robust_rounds.reach_of_range * plan.range_mm);
    const std::vector<CurveMatch> found = matches(state, reach);
    const double typical = median_distance(found);
    if (plan.number == 0 && !std::isfinite(typical))
        throw InvalidInput("no intraoperative point along vessels lies within " + to_text(reach) +
                           " mm of the preoperative curves; check the frame and the unit of the points");
    if (plan.number == 0) scale_.begin_at(robust_rounds.first_of_median * typical);
    const double scale = scale_.of(plan, final_scale_mm());
    const double stiffness = energy_ / (data_.deviation_mm * data_.deviation_mm);
    Contribution result;
    std::vector<Pull> pulls;
    double weights = 0;
    for (std::size_t n = 0; n < found.size(); ++n) {
        const CurveMatch& match = found[n];
        if (!match.found) continue;
        ++result.matched;
        const double share = data_.shares[static_cast<Eigen::Index>(n)];
        const double weight = share * robust_weight(match.hit.distance, scale);
        add_pulls(match, weight * stiffness, state, plan.most_step_mm, pulls);
        result.mean_residual_mm += weight * match.across.norm();
        weights += weight;
    }
    if (weights > 0) result.mean_residual_mm /= weights;
    result.candidates = static_cast<int>(found.size());
    result.springs = pulled_by(curve_kind, lumped_springs(prepared_.model.mesh, pulls, state.displacement));
    return result;
}

CurveFit CurveTerm::fit(const State& state) const {
    CurveFit fit;
    fit.points = static_cast<int>(data_.count());
    double squared = 0;
    int inliers = 0;
    for (const CurveMatch& match : matches(state, final_scale_mm())) {
        if (!match.found) continue;
        ++inliers;
        squared += match.across.squaredNorm();
    }
    fit.inlier_share = inliers / double(fit.points);
    fit.residual_mm = inliers > 0 ? std::sqrt(squared / inliers) : final_scale_mm();
    fit.rival_mm = rival_mm_;
    fit.rival_support = rival_support_;
    for (const meshing::Segment& segment : segments_)
        fit.length_mm += (samples_.col(segment.ends[1]) - samples_.col(segment.ends[0])).norm();
    return fit;
}

void CurveTerm::judge(const State& state, UpdateResult& result) {
    result.curves = fit(state);
    for (Doubt& doubt : doubts_of(*result.curves, data_.deviation_mm)) result.doubts.push_back(std::move(doubt));
}

}  // namespace tissuewarp::registration::detail
