#include "registration/pose/curve_pose.hpp"

#include "registration/pose/robust_weight.hpp"

#include <tbb/parallel_for.h>
#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissuewarp::registration::detail {

namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr double everywhere = std::numeric_limits<double>::infinity();

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
    Eigen::Matrix3d matrix;
    matrix << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
    return matrix;
}

/// What one step sees of the lines: weights of the matches, and the middle and the radius of the places.
struct Weighed {
    std::vector<double> weights;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    double radius = 1;  // mm, so that turns count in mm
};

Weighed weigh(const std::vector<CurveMatch>& matches, const CurvePoints& points, double scale) {
    Weighed result;
    double sum = 0, squared = 0;
    for (std::size_t n = 0; n < matches.size(); ++n) {
        const CurveMatch& match = matches[n];
        const double weight =
            match.found ? points.shares[static_cast<Eigen::Index>(n)] * robust_weight(match.hit.distance, scale) : 0.0;
        result.weights.push_back(weight);
        result.centre += weight * match.hit.point;
        squared += weight * match.hit.point.squaredNorm();
        sum += weight;
    }
    if (sum <= 0) return result;
    result.centre /= sum;
    result.radius = std::sqrt(std::max(1.0, squared / sum - result.centre.squaredNorm()));
    return result;
}

/// The small motion of the lines, in the moving frame: δ = (shift, turn · radius) of
/// (Σ w JᵀJ + λ) δ = Σ w Jᵀ across with J = P [1, −[q − c]×/radius], P the projection across the line.
Eigen::Isometry3d step(const std::vector<CurveMatch>& matches, const Weighed& weighed) {
    Matrix6d normal = Matrix6d::Zero();
    Vector6d right = Vector6d::Zero();
    for (std::size_t n = 0; n < matches.size(); ++n) {
        if (weighed.weights[n] <= 0) continue;
        const meshing::CurveTree::Hit& hit = matches[n].hit;
        const Eigen::Matrix3d projection = Eigen::Matrix3d::Identity() - hit.tangent * hit.tangent.transpose();
        Eigen::Matrix<double, 3, 6> jacobian;
        jacobian << projection, -projection * cross_matrix((hit.point - weighed.centre) / weighed.radius);
        normal += weighed.weights[n] * jacobian.transpose() * jacobian;
        right += weighed.weights[n] * jacobian.transpose() * matches[n].across;
    }
    normal.diagonal().array() += curve_pose_options.damping * normal.trace() / 6 + std::numeric_limits<double>::min();
    const Vector6d delta = normal.ldlt().solve(right);
    const Eigen::Vector3d turn = delta.tail<3>() / weighed.radius;
    const Eigen::Vector3d shift = delta.head<3>();
    const Eigen::AngleAxisd rotation(turn.norm(), turn.stableNormalized());
    return Eigen::Translation3d(weighed.centre + shift) * rotation * Eigen::Translation3d(-weighed.centre);
}

/// Mean of d²/(d² + s²) over the points, 1 where no line has the tangent.
double cost(const std::vector<CurveMatch>& matches, const CurvePoints& points, double scale) {
    double sum = 0;
    for (std::size_t n = 0; n < matches.size(); ++n) {
        const double squared = matches[n].hit.distance * matches[n].hit.distance;
        sum +=
            points.shares[static_cast<Eigen::Index>(n)] * (matches[n].found ? squared / (squared + scale * scale) : 1);
    }
    return sum / points.shares.sum();
}

FoundPose descend(const meshing::CurveTree& lines, const CurvePoints& points, Eigen::Isometry3d placement,
                  double last_scale_mm, double max_angle_deg) {
    constexpr CurvePoseOptions rules = curve_pose_options;
    double scale = 0;
    for (int pass = 0; pass < rules.passes; ++pass) {
        const auto matches = match_curves(lines, points, placement, everywhere, max_angle_deg);
        scale = pass == 0 ? rules.first_of_median * median_distance(matches) : rules.falling * scale;
        scale = std::max(scale, last_scale_mm);
        if (!std::isfinite(scale)) return {placement, 1};
        placement = placement * step(matches, weigh(matches, points, scale));
    }
    return {placement, cost(match_curves(lines, points, placement, everywhere, max_angle_deg), points, last_scale_mm)};
}

/// Of the moving frame.
std::vector<Eigen::Isometry3d> starts(const meshing::CurveTree& lines, const CurvePoints& points,
                                      const Eigen::Isometry3d& start) {
    const Eigen::Vector3d middle = points.points.rowwise().mean(),
                          middle_of_lines = start * lines.points().rowwise().mean();
    std::vector<Eigen::Isometry3d> result;
    for (const Eigen::Vector3d& shift : {Eigen::Vector3d::Zero().eval(), (middle - middle_of_lines).eval()})
        for (const Eigen::Matrix3d& rotation : start_rotations(curve_pose_options.start_rotation_deg)) {
            Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
            turn.linear() = rotation;
            turn.translation() = middle + rotation * (shift - middle);
            result.push_back(turn * start);
        }
    return result;
}

}  // namespace

ChosenPose search_curve_pose(const meshing::CurveTree& lines, const CurvePoints& points, const Eigen::Isometry3d& start,
                             double last_scale_mm, double max_angle_deg) {
    const std::vector<Eigen::Isometry3d> from = starts(lines, points, start);
    std::vector<FoundPose> found(from.size());
    tbb::parallel_for(std::size_t{0}, from.size(),
                      [&](std::size_t k) { found[k] = descend(lines, points, from[k], last_scale_mm, max_angle_deg); });
    return choose_pose(found, lines.points(), start);
}

}  // namespace tissuewarp::registration::detail
