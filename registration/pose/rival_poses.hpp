#pragma once
/// Which of several poses is taken where more than one explains the data.

#include "core/observer.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace tissuewarp::registration::detail {

/// Chosen on the random patients 1 to 60 of the families *bent* and *labelled*, from a part of the surface: of 60
/// smooth organs the best pose was wrong by more than a centimetre for 34, and the chosen one for 17 whatever from 0.70
/// to 0.97 `alike` was (docs/decisions/error_model.md).
struct RivalPoseOptions {
    double same_pose_mm = 8;  ///< mean over the organ: poses closer than this are one, others rivals
    double alike = 0.95;      ///< of what the best pose explains: poses that explain as much are told apart by headers
    /// Times as far as the chosen pose: a pose that moves the organ so far from where the headers place it is no rival.
    /// Chosen on 641 to 660 of the three families of `study coverage`: all six failures had a rival up to 2.5 times as
    /// far, and 47 of 54 good results none up to 3.
    double headers_tell = 3;
};
inline constexpr RivalPoseOptions rival_pose_options{};

/// A pose that a search has found.
struct FoundPose {
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed
    double cost = 1;  ///< mean over the data of d²/(d² + s²): 0 where it explains them all, 1 where none

    /// d at which d²/(d² + s²) is the cost.
    [[nodiscard]] double typical_distance_mm(double scale_mm) const {
        return scale_mm * std::sqrt(cost / std::max(1e-9, 1 - cost));
    }
};

/// Two poses that explain the data, the first chosen.
struct ChosenPose {
    FoundPose chosen;
    double rival_cost = 1;    ///< of the best pose that is another and that the headers do not rule out
    double rival_mm = 0;      ///< and how far the organ lies from it there, mean over its places
    double ruled_out_mm = 0;  ///< how far it lies from it in the best pose that only headers rule out; 0: there is none

    /// What that one explains over what the chosen one does.
    [[nodiscard]] double rival_support() const { return chosen.cost < 1 ? (1 - rival_cost) / (1 - chosen.cost) : 1; }
};

/// The best ones, ascending by cost, at most `most`, no two of them nearly the same of these places of the organ (3 ×
/// N, mm, moving frame).
std::vector<FoundPose> distinct_poses(std::vector<FoundPose> poses, const Eigen::Matrix3Xd& places, std::size_t most);

/// Of distinct poses that explain nearly as much as the best the one that moves the organ least from `start`: a patch
/// fits all round a smooth organ, and where the headers place it is the likelier. Precondition: some pose was found.
ChosenPose choose_pose(const std::vector<FoundPose>& found, const Eigen::Matrix3Xd& places,
                       const Eigen::Isometry3d& start);

/// Tells that only headers rule out another pose, where they do. `data` in words: "the points".
void tell_what_headers_decide(const ChosenPose& pose, const std::string& data, Observer& observer);

/// About the corners of an icosahedron by an angle, none first: starts all around one.
std::vector<Eigen::Matrix3d> start_rotations(double angle_deg);

/// The 48 signed permutations of the axes: 24 rotations, the identity first, and their reflections.
std::vector<Eigen::Matrix3d> symmetries_of_a_cube();

}  // namespace tissuewarp::registration::detail
