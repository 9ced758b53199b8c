#include "registration/pose/rival_poses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

namespace tissuewarp::registration::detail {

namespace {

double mean_distance_mm(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, const Eigen::Matrix3Xd& places) {
    return ((a * places) - (b * places)).colwise().norm().mean();
}

}  // namespace

std::vector<FoundPose> distinct_poses(std::vector<FoundPose> poses, const Eigen::Matrix3Xd& places, std::size_t most) {
    std::stable_sort(poses.begin(), poses.end(),
                     [](const FoundPose& a, const FoundPose& b) { return a.cost < b.cost; });
    std::vector<FoundPose> kept;
    for (const FoundPose& pose : poses) {
        if (kept.size() == most) break;
        const auto same = [&](const FoundPose& other) {
            return mean_distance_mm(pose.placement, other.placement, places) < rival_pose_options.same_pose_mm;
        };
        if (std::none_of(kept.begin(), kept.end(), same)) kept.push_back(pose);
    }
    return kept;
}

ChosenPose choose_pose(const std::vector<FoundPose>& found, const Eigen::Matrix3Xd& places,
                       const Eigen::Isometry3d& start) {
    const std::vector<FoundPose> poses = distinct_poses(found, places, found.size());
    const auto alike = [&](const FoundPose& pose) {
        return 1 - pose.cost >= rival_pose_options.alike * (1 - poses.front().cost);
    };
    const auto last = std::find_if_not(poses.begin(), poses.end(), alike);
    const auto motion_mm = [&](const FoundPose& pose) { return mean_distance_mm(pose.placement, start, places); };
    const auto chosen = std::min_element(
        poses.begin(), last, [&](const FoundPose& a, const FoundPose& b) { return motion_mm(a) < motion_mm(b); });
    ChosenPose result{*chosen};
    const double near_mm =
        rival_pose_options.headers_tell * std::max(rival_pose_options.same_pose_mm, motion_mm(*chosen));
    const auto best_other = [&](auto first, auto end, auto admits) {
        const auto other =
            std::find_if(first, end, [&](const FoundPose& pose) { return &pose != &*chosen && admits(pose); });
        return other == end ? nullptr : &*other;
    };
    const auto from_chosen_mm = [&](const FoundPose& pose) {
        return mean_distance_mm(pose.placement, chosen->placement, places);
    };
    const auto is_near = [&](const FoundPose& pose) { return motion_mm(pose) < near_mm; };
    if (const FoundPose* rival = best_other(poses.begin(), poses.end(), is_near)) {
        result.rival_cost = rival->cost;
        result.rival_mm = from_chosen_mm(*rival);
    }
    if (const FoundPose* far = best_other(poses.begin(), last, std::not_fn(is_near)))
        result.ruled_out_mm = from_chosen_mm(*far);
    return result;
}

void tell_what_headers_decide(const ChosenPose& pose, const std::string& data, Observer& observer) {
    if (pose.ruled_out_mm > 0)
        observer.note(data + " fit about as well with the organ placed " +
                      std::to_string(std::lround(pose.ruled_out_mm)) +
                      " mm elsewhere; it was left near where the headers place it");
}

std::vector<Eigen::Matrix3d> start_rotations(double angle_deg) {
    std::vector<Eigen::Matrix3d> rotations{Eigen::Matrix3d::Identity()};
    const double golden = 0.5 * (1 + std::sqrt(5.0));
    for (int axis = 0; axis < 3; ++axis)
        for (const double a : {-1.0, 1.0})
            for (const double b : {-golden, golden}) {
                Eigen::Vector3d corner = Eigen::Vector3d::Zero();
                corner[(axis + 1) % 3] = a;
                corner[(axis + 2) % 3] = b;
                rotations.emplace_back(
                    Eigen::AngleAxisd(angle_deg * EIGEN_PI / 180, corner.normalized()).toRotationMatrix());
            }
    return rotations;
}

std::vector<Eigen::Matrix3d> symmetries_of_a_cube() {
    std::vector<Eigen::Matrix3d> result;
    std::array<int, 3> axes{0, 1, 2};
    do
        for (int signs = 0; signs < 8; ++signs) {
            Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
            for (int row = 0; row < 3; ++row)
                matrix(row, axes[static_cast<std::size_t>(row)]) = signs >> row & 1 ? -1 : 1;
            result.push_back(matrix);
        }
    while (std::next_permutation(axes.begin(), axes.end()));
    return result;
}

}  // namespace tissuewarp::registration::detail
