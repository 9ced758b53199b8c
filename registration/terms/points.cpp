#include "registration/terms/points.hpp"

#include "registration/doubts.hpp"
#include "registration/pose/rigid_part.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace tissuewarp::registration::detail {

namespace {

void require_usable(const PointPairs& pairs) {
    if (pairs.moving.cols() == 0 || pairs.moving.cols() != pairs.fixed.cols())
        throw InvalidInput("the paired points are " + std::to_string(pairs.moving.cols()) + " moving and " +
                           std::to_string(pairs.fixed.cols()) + " fixed ones; give as many of each, at least one");
    if (!pairs.moving.allFinite() || !pairs.fixed.allFinite())
        throw InvalidInput("paired points hold coordinates that are not finite; remove those pairs");
    if (!(pairs.deviation_mm > 0) || !std::isfinite(pairs.deviation_mm))
        throw InvalidInput("the standard deviation of paired points is " + to_text(pairs.deviation_mm) +
                           " mm; a positive number is needed");
}

/// Second largest standard deviation along the principal axes, mm: zero for points on a line.
double width(const Eigen::Matrix3Xd& points) {
    const Eigen::Matrix3Xd centred = points.colwise() - points.rowwise().mean();
    const Eigen::Matrix3d covariance = centred * centred.transpose() / double(points.cols());
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance, Eigen::EigenvaluesOnly);
    return std::sqrt(std::max(0.0, axes.eigenvalues()[1]));
}

double median(const Eigen::RowVectorXd& given) {
    std::vector<double> values(given.begin(), given.end());
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace

std::vector<Doubt> doubts_of(const PointFit& fit) {
    std::vector<Doubt> doubts;
    constexpr double most_outliers = point_doubt_limits.most_outliers;
    if (fit.outliers > most_outliers * fit.used)
        doubts.push_back({"points.outliers", fit.outliers / double(fit.used), most_outliers,
                          std::to_string(fit.outliers) + " of " + std::to_string(fit.used) +
                              " pairs of points do not fit the tissue",
                          "check that they are the same places in both images"});
    return doubts;
}

PointTerm::PointTerm(const PreparedModel& prepared, const PointPairs& pairs, const PointOptions& options, double energy)
    : prepared_(prepared), options_(options), energy_(energy), deviation_mm_(pairs.deviation_mm) {
    require_usable(pairs);
    const meshing::PointLocator locator(prepared.model.mesh);
    std::vector<Eigen::Index> kept;
    for (Eigen::Index n = 0; n < pairs.moving.cols(); ++n)
        if (const auto at = locate_near(locator, pairs.moving.col(n))) {
            kept.push_back(n);
            places_.push_back(*at);
        }
    if (kept.empty())
        throw InvalidInput("none of the " + std::to_string(pairs.moving.cols()) +
                           " moving points to register to lies in the model; coordinates must be LPS mm of the moving "
                           "image: for RAS, negate x and y");
    moving_ = pairs.moving(Eigen::all, kept);
    fixed_ = pairs.fixed(Eigen::all, kept);
}

bool PointTerm::show_rotation() const {
    return moving_.cols() >= 3 && width(moving_) > point_pose_options.least_width_deviations * deviation_mm_;
}

Alignment PointTerm::pose(const Eigen::Isometry3d& /*start*/, Observer& /*observer*/) {
    constexpr PointPoseOptions rules = point_pose_options;
    Eigen::VectorXd weights = Eigen::VectorXd::Ones(moving_.cols());
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    Eigen::RowVectorXd distances;
    double scale = 0;
    for (int pass = 0; pass < rules.passes; ++pass) {
        if (show_rotation())
            motion = closest_motion(moving_, fixed_, weights);
        else
            motion.translation() = (fixed_ - moving_) * weights / weights.sum();
        distances = ((motion * moving_) - fixed_).colwise().norm();
        scale = pass == 0 ? rules.first_of_largest * distances.maxCoeff() : rules.falling * scale;
        scale = std::max(scale, rules.bending_mm + final_scale_mm());
        for (Eigen::Index n = 0; n < weights.size(); ++n) weights[n] = robust_weight(distances[n], scale);
    }
    return {motion, distances.dot(weights.transpose()) / weights.sum()};
}

Eigen::Matrix3Xd PointTerm::residuals(const State& state) const {
    Eigen::Matrix3Xd result = (state.placement.inverse() * fixed_) - moving_;
    for (std::size_t n = 0; n < places_.size(); ++n)
        result.col(static_cast<Eigen::Index>(n)) -=
            displacement_at(prepared_.model.mesh, state.displacement, places_[n]);
    return result;
}

Contribution PointTerm::linearise(const RoundPlan& plan, const State& state, Observer& /*observer*/) {
    const Eigen::Matrix3Xd away = residuals(state);
    if (plan.number == 0) scale_.begin_at(robust_rounds.first_of_median * median(away.colwise().norm()));
    const double scale = scale_.of(plan, final_scale_mm());
    const double stiffness = energy_ / (deviation_mm_ * deviation_mm_);
    Contribution result;
    std::vector<Pull> pulls;
    double weights = 0;
    for (std::size_t n = 0; n < places_.size(); ++n) {
        const Eigen::Vector3d e = away.col(static_cast<Eigen::Index>(n));
        const double distance = e.norm(), weight = robust_weight(distance, scale);
        const double step = std::min(1.0, plan.most_step_mm / std::max(distance, 1e-9));
        pulls.push_back({places_[n], displacement_at(prepared_.model.mesh, state.displacement, places_[n]) + step * e,
                         weight * stiffness * Eigen::Matrix3d::Identity()});
        result.held_back += weight > robust_rounds.held_back_weight && distance > plan.most_step_mm;
        result.mean_residual_mm += weight * distance;
        weights += weight;
    }
    if (weights > 0) result.mean_residual_mm /= weights;
    result.candidates = result.matched = static_cast<int>(places_.size());
    result.springs = pulled_by(point_kind, lumped_springs(prepared_.model.mesh, pulls, state.displacement));
    return result;
}

PointFit PointTerm::fit(const State& state) const {
    PointFit fit;
    fit.used = static_cast<int>(places_.size());
    double squared = 0;
    const Eigen::Matrix3Xd away = residuals(state);
    for (const auto& e : away.colwise()) {
        if (e.norm() > final_scale_mm())
            ++fit.outliers;
        else
            squared += e.squaredNorm();
    }
    if (fit.used > fit.outliers) fit.residual_mm = std::sqrt(squared / (fit.used - fit.outliers));
    return fit;
}

void PointTerm::judge(const State& state, UpdateResult& result) {
    result.points = fit(state);
    for (Doubt& doubt : doubts_of(*result.points)) result.doubts.push_back(std::move(doubt));
}

}  // namespace tissuewarp::registration::detail
