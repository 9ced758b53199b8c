#include "registration/terms/surface.hpp"

#include "registration/doubts.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

constexpr double least_deviation_mm = surface_pull_options.least_deviation_mm;

}  // namespace

std::vector<Doubt> doubts_of(const SurfaceFit& fit, double deviation_mm) {
    std::vector<Doubt> doubts;
    const double least_inliers = surface_doubt_limits.least_inliers, most_residual = surface_doubt_limits.most_residual,
                 most_rival_support = rival_pose_options.alike, least_coverage = surface_doubt_limits.least_coverage;
    const double residual_limit = most_residual * std::max(deviation_mm, least_deviation_mm);
    if (fit.inlier_share < least_inliers)
        doubts.push_back({"surface.outliers", fit.inlier_share, least_inliers,
                          "only " + percent(fit.inlier_share) + " of the intraoperative surface lies on the model",
                          "check that the points are of this organ, in LPS mm"});
    if (fit.residual_mm > residual_limit)
        doubts.push_back({"surface.apart", fit.residual_mm, residual_limit,
                          "points of the intraoperative surface lie " + to_text(fit.residual_mm) +
                              " mm from the model where " + to_text(deviation_mm) + " mm were stated",
                          "state how far off the points are (--surface-sd), or leave out what is not of this organ"});
    if (!fit.pose_searched) return doubts;
    if (fit.coverage < least_coverage)
        doubts.push_back(
            {"surface.too_small", fit.coverage, least_coverage,
             "the points show " + percent(fit.coverage) + " of the organ's surface, too little to tell where it lies",
             "show more of it, give pairs of points, or leave it where the headers place it if they are right "
             "(--no-align)"});
    if (fit.rival_support > most_rival_support)
        doubts.push_back(
            {"surface.two_poses", fit.rival_support, most_rival_support,
             "the points fit about as well with the organ placed " + to_text(fit.rival_mm) + " mm elsewhere",
             "give a wider patch, or landmarks"});
    return doubts;
}

SurfaceTerm::SurfaceTerm(const PreparedModel& prepared, std::shared_ptr<const OrganSurface> organ,
                         const SurfacePoints& points, const SurfaceOptions& options, const AlignmentOptions& alignment,
                         double energy)
    : prepared_(prepared),
      options_(options),
      alignment_(alignment),
      data_(surface_data(points)),
      surface_(std::move(organ)),
      energy_(energy),
      inward_(normals_point_inwards()) {}

bool SurfaceTerm::normals_point_inwards() const {
    if (!data_.oriented) return false;
    const meshing::SurfaceTree tree(surface_->at_rest);
    Eigen::Index near = 0, inward = 0;
    for (Eigen::Index n = 0; n < data_.count(); ++n) {
        const auto hit = tree.closest(data_.points.col(n), surface_doubt_limits.headers_reach_mm);
        near += hit.has_value();
        inward += hit && hit->normal.dot(data_.normals.col(n)) < 0;
    }
    return double(near) >= surface_doubt_limits.least_near * double(data_.count()) &&
           double(inward) >= surface_doubt_limits.least_inward * double(near);
}

double SurfaceTerm::final_scale_mm() const {
    return options_.outlier_deviations * std::max(data_.deviation_mm, least_deviation_mm);
}

Alignment SurfaceTerm::pose(const Eigen::Isometry3d& /*start*/, Observer& observer) {
    const SurfacePose found =
        search_surface_pose(meshing::SurfaceTree(surface_->at_rest), surface_->at_rest, data_, alignment_, observer);
    tell_what_headers_decide(found.pose, "the points", observer);
    pose_ = {found.scale_mm > 0, found.pose.rival_mm, found.pose.rival_support()};
    return {found.pose.chosen.placement, found.pose.chosen.typical_distance_mm(found.scale_mm)};
}

bool SurfaceTerm::take_over(const UpdateResult& last) {
    if (!last.surface) return false;
    pose_ = {last.surface->pose_searched, last.surface->rival_mm, last.surface->rival_support};
    return true;
}

std::vector<SurfaceTerm::Match> SurfaceTerm::matches(const State& state, double reach_mm) const {
    const meshing::SurfaceTree tree(surface_->deformed(state.displacement));
    const Eigen::Isometry3d back = state.placement.inverse();
    const double least_cosine = std::cos(options_.max_angle_deg * EIGEN_PI / 180);
    std::vector<Match> result(static_cast<std::size_t>(data_.count()));
    tbb::parallel_for(std::size_t{0}, result.size(), [&](std::size_t n) {
        const auto column = static_cast<Eigen::Index>(n);
        const Eigen::Vector3d point = back * data_.points.col(column);
        const Eigen::Vector3d normal = back.linear() * data_.normals.col(column);
        const auto hit = tree.closest(point, reach_mm, {normal, least_cosine, data_.oriented});
        if (!hit) return;
        const double sign = normal.dot(hit->normal) < 0 ? -1 : 1;
        Match& match = result[n];
        match.found = true;
        match.hit = *hit;
        match.normal = (hit->normal + sign * normal).normalized();
        match.distance_mm = match.normal.dot(point - hit->point);
    });
    return result;
}

/// K = energy/σ² · area/patch² · weight · n nᵀ, at the point of the surface's triangle.
Pull SurfaceTerm::pull_of(const Match& match, double area, double weight, const State& state,
                          double most_step_mm) const {
    const meshing::TetMesh& mesh = prepared_.model.mesh;
    Pull pull;
    pull.at = surface_->location(match.hit.triangle, match.hit.barycentric, mesh);
    const double deviation = std::max(data_.deviation_mm, least_deviation_mm);
    const double stiffness =
        weight * energy_ / (deviation * deviation) * area / (options_.patch_mm * options_.patch_mm);
    pull.stiffness = stiffness * match.normal * match.normal.transpose();
    pull.target = displacement_at(mesh, state.displacement, pull.at) +
                  std::clamp(match.distance_mm, -most_step_mm, most_step_mm) * match.normal;
    return pull;
}

Contribution SurfaceTerm::linearise(const RoundPlan& plan, const State& state, Observer& /*observer*/) {
    const double reach =
        std::max(robust_rounds.reach_of_scale * final_scale_mm(), robust_rounds.reach_of_range * plan.range_mm);
    const std::vector<Match> found = matches(state, reach);
    if (plan.number == 0) {
        std::vector<double> distances;
        for (const Match& match : found)
            if (match.found) distances.push_back(std::abs(match.distance_mm));
        if (distances.empty())
            throw InvalidInput("no point of the intraoperative surface lies within " + to_text(reach) +
                               (inward_ ? " mm of a part of the model that faces as it does; its normals point "
                                          "inwards: turn them round"
                                        : " mm of the model; check the frame and the unit of the points"));
        const auto high = distances.begin() +
                          static_cast<std::ptrdiff_t>(double(distances.size() - 1) * robust_rounds.first_percentile);
        std::nth_element(distances.begin(), high, distances.end());
        scale_.begin_at(robust_rounds.first_of_percentile * *high);
    }
    const double scale = scale_.of(plan, final_scale_mm());
    Contribution result;
    std::vector<Pull> pulls;
    double weights = 0;
    for (std::size_t n = 0; n < found.size(); ++n) {
        const Match& match = found[n];
        if (!match.found) continue;
        const double weight = robust_weight(match.distance_mm, scale), area = data_.areas[static_cast<Eigen::Index>(n)];
        pulls.push_back(pull_of(match, area, weight, state, plan.most_step_mm));
        result.held_back += weight > robust_rounds.held_back_weight && std::abs(match.distance_mm) > plan.most_step_mm;
        result.mean_residual_mm += area * weight * std::abs(match.distance_mm);
        weights += area * weight;
    }
    if (weights > 0) result.mean_residual_mm /= weights;
    result.candidates = static_cast<int>(found.size());
    result.matched = static_cast<int>(pulls.size());
    result.springs = pulled_by(surface_kind(prepared_.labels.geometry),
                               lumped_springs(prepared_.model.mesh, pulls, state.displacement));
    return result;
}

SurfaceFit SurfaceTerm::fit(const State& state) const {
    const double limit = final_scale_mm();
    SurfaceFit fit;
    double area = 0, squared = 0;
    int inliers = 0;
    const std::vector<Match> found = matches(state, robust_rounds.reach_of_scale * limit);
    for (std::size_t n = 0; n < found.size(); ++n) {
        if (!found[n].found || std::abs(found[n].distance_mm) > limit) continue;
        ++inliers;
        area += data_.areas[static_cast<Eigen::Index>(n)];
        squared += found[n].distance_mm * found[n].distance_mm;
    }
    fit.inlier_share = inliers / double(found.size());
    fit.residual_mm = inliers > 0 ? std::sqrt(squared / inliers) : limit;
    fit.coverage = area / surface_->area();
    fit.pose_searched = pose_.searched;
    fit.rival_mm = pose_.rival_mm;
    fit.rival_support = pose_.rival_support;
    return fit;
}

void SurfaceTerm::judge(const State& state, UpdateResult& result) {
    result.surface = fit(state);
    for (Doubt& doubt : doubts_of(*result.surface, data_.deviation_mm)) result.doubts.push_back(std::move(doubt));
    if (inward_)
        result.doubts.push_back(
            {"surface.normals_inward", 1, 0,
             "the normals of the intraoperative surface point inwards where the headers place its points",
             "turn them round: normals point out of the organ"});
}

}  // namespace tissuewarp::registration::detail
