#pragma once
/// Where the organ as a whole lies, by costs of shifts.

#include "core/observer.hpp"
#include "registration/matching/ultrasound/echo_costs.hpp"

#include <Eigen/Geometry>

#include <vector>

namespace tissuewarp::registration::detail {

/// What is expected of tracking, and how poses are searched. Chosen on `study coverage --problems ultrasound:1-12`.
struct EchoPoseOptions {
    double shift_mm = 8, turn_deg = 5;   ///< deviations of the placement by the headers
    double most_mm = 15, most_deg = 10;  ///< that are searched
    double independent_mm3 = 300;        ///< of ultrasound that say one thing of their own about a pose
    double start_turn_deg = 6;
    int starts = 6, turned_starts = 2;  ///< shifts that are starts; those that are turned too
    int evaluations = 300;              ///< of a search
    double rival_mm = 6;                ///< farther from the best, in the mean over places, a pose is another one
};

struct EchoPose {
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();  ///< of the tissue, in the frame of the places
    double support = 0;        ///< what speaks for it against chance, by the weights that tell poses apart
    double rival_mm = 0;       ///< how far the best other pose lies from it; 0: there is none
    double rival_support = 0;  ///< of that one
};

/// Costs of one kind, and how much they count against those of another: when poses are told apart, and when the best of
/// them is made finer.
struct PoseCosts {
    EchoCosts costs;
    double weight = 1, finer_weight = 1;
};

/// All have the same lattice of shifts.
EchoPose echo_pose(const std::vector<PoseCosts>& kinds, const EchoPoseOptions& options, Observer& observer);

}  // namespace tissuewarp::registration::detail
