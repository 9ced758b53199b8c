#pragma once
/// What one round of a registration knows, and what it asks of the solver.

#include "registration/pipeline.hpp"
#include "tled/conditions.hpp"

namespace tissuewarp::registration::detail {

/// Where the model is.
struct State {
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed
    Eigen::Matrix3Xd displacement;                                ///< 3 × N, mm, moving frame
};

/// How far this round looks, and how much it trusts what the model did not follow.
struct RoundPlan {
    int number = 0;
    bool last = false;
    double range_mm = 0;  ///< of the search along normals
    double scale_mm = 0;  ///< of the Geman–McClure weight (σ²/(σ² + d²))², which lowers what the model did not follow
    double most_step_mm = 0;  ///< most that a surface node is asked to move, so that elements are not turned over
};

/// What a datum contributed to a round.
struct Contribution {
    tled::Conditions conditions;
    std::vector<tled::Spring> holds;  ///< of labels: pull nodes to where they are, for the sake of the solver
    int candidates = 0, matched = 0;
    int held_back = 0;            ///< matches further away than the round's step bound
    double mean_residual_mm = 0;  ///< weighted, before the round's equilibrium
};

/// Data of two kinds together: springs add up, the residual is the mean over matches.
void add(Contribution& sum, Contribution more);

/// (σ²/(σ² + d²))²: the Geman–McClure function's weight in iteratively reweighted least squares.
inline double robust_weight(double distance_mm, double scale_mm) {
    const double squared = scale_mm * scale_mm, share = squared / (squared + distance_mm * distance_mm);
    return share * share;
}

}  // namespace tissuewarp::registration::detail
