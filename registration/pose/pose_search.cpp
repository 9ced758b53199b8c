#include "registration/pose/pose_search.hpp"

#include "registration/pose/pose_space.hpp"

#include <tbb/parallel_for.h>
#include <nlopt.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

constexpr std::size_t most_parameters = 7;

constexpr PoseSearchOptions rules;

struct Pose {
    std::array<double, most_parameters> x{};
    double cost = 0;
};

/// One search: what is minimised and how finely.
struct Problem {
    const PoseCost& cost;
    const PoseSpace& space;
    unsigned parameters;
    double trim;
    int stride;

    [[nodiscard]] double operator()(const Pose& pose) const {
        return cost(space.similarity(pose.x.data()), trim, stride) +
               rules.rotation_penalty * std::hypot(pose.x[3], pose.x[4], pose.x[5]);
    }
};

Pose minimise(const Problem& problem, Pose start, int evaluations) {
    nlopt::opt optimiser(nlopt::LN_BOBYQA, problem.parameters);
    const auto objective = [](unsigned count, const double* x, double*, void* data) {
        Pose pose;
        std::copy(x, x + count, pose.x.begin());
        return (*static_cast<const Problem*>(data))(pose);
    };
    Problem copy = problem;  // NLopt takes a pointer to mutable data
    optimiser.set_min_objective(objective, &copy);
    optimiser.set_initial_step(std::max(rules.least_first_step_mm, problem.trim / rules.trims_of_first_step));
    optimiser.set_xtol_abs(rules.tolerance_mm);
    optimiser.set_maxeval(evaluations);
    std::vector<double> x(start.x.begin(), start.x.begin() + problem.parameters);
    try {
        optimiser.optimize(x, start.cost);
    } catch (const nlopt::roundoff_limited&) {
        // The best point so far is in x: as good as this cost can be resolved.
    }
    std::copy(x.begin(), x.end(), start.x.begin());
    start.cost = problem(start);
    return start;
}

std::vector<Pose> starting_poses(const PoseSpace& space, const Eigen::Vector3d& fixed_centroid, double angle) {
    const Eigen::Vector3d shift = fixed_centroid - space.centre;
    std::vector<Pose> starts(2);
    std::copy(shift.begin(), shift.end(), starts[1].x.begin());
    for (std::size_t axis = 3; axis < 6; ++axis)
        for (const double sign : {-1.0, 1.0}) {
            Pose turned = starts[1];
            turned.x[axis] = sign * angle * space.radius;
            starts.push_back(turned);
        }
    return starts;
}

}  // namespace

Alignment search_pose(const PoseCost& cost, const Eigen::Matrix3Xd& moving_points,
                      const Eigen::Vector3d& fixed_centroid, PoseFreedom freedom, const AlignmentOptions& options,
                      Observer& observer) {
    const Eigen::Vector3d centre = moving_points.rowwise().mean();
    const PoseSpace space{centre, std::sqrt((moving_points.colwise() - centre).colwise().squaredNorm().mean())};
    const auto parameters = static_cast<unsigned>(freedom);

    std::vector<Pose> poses = starting_poses(space, fixed_centroid, options.start_angle_deg * EIGEN_PI / 180);
    const Problem coarse{cost, space, parameters, rules.coarse_trims * options.trim_mm, rules.coarse_stride};
    tbb::parallel_for(std::size_t{0}, poses.size(),
                      [&](std::size_t i) { poses[i] = minimise(coarse, poses[i], rules.coarse_evaluations); });
    observer.checkpoint("rigid alignment", 0.6);
    std::stable_sort(poses.begin(), poses.end(), [](const Pose& a, const Pose& b) { return a.cost < b.cost; });
    poses.resize(rules.finalists);
    const Problem fine{cost, space, parameters, options.trim_mm, 1};
    tbb::parallel_for(std::size_t{0}, poses.size(),
                      [&](std::size_t i) { poses[i] = minimise(fine, poses[i], rules.fine_evaluations); });
    observer.checkpoint("rigid alignment", 1.0);
    const Pose& best = poses[1].cost < poses[0].cost ? poses[1] : poses[0];
    return {space.rigid(best.x.data()), cost(space.similarity(best.x.data()), options.trim_mm, 1)};
}

}  // namespace tissuewarp::registration::detail
