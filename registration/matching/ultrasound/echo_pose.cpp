#include "registration/matching/ultrasound/echo_pose.hpp"

#include <tbb/parallel_for.h>
#include <nlopt.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

using Pose = std::array<double, 6>;  // shift of the middle and rotation vector times the radius, mm

/// Of one kind of costs.
class KindEvidence {
public:
    KindEvidence(const EchoCosts& costs, double independent_mm3)
        : costs_(costs), along_(costs_.places.direction.transpose() / costs_.step_mm) {
        const std::size_t lattice = costs_.lattice();
        const double independent = costs_.places.voxel_volume() / independent_mm3;
        evidence_.resize(costs_.cost.size());
        places_.resize(3, static_cast<Eigen::Index>(costs_.at.size()));
        tbb::parallel_for(std::size_t{0}, costs_.at.size(), [&](std::size_t n) {
            places_.col(static_cast<Eigen::Index>(n)) = costs_.place(n);
            add_evidence(costs_.of(n), lattice, independent * costs_.window_share[n], evidence_.data() + n * lattice);
        });
    }

    [[nodiscard]] const EchoCosts& costs() const { return costs_; }
    [[nodiscard]] const Eigen::Matrix3Xd& places() const { return places_; }

    /// −log odds of each shift of the lattice against chance.
    [[nodiscard]] Eigen::VectorXd of_shifts() const {
        const auto lattice = static_cast<Eigen::Index>(costs_.lattice());
        Eigen::VectorXf total = Eigen::VectorXf::Zero(lattice);
        for (std::size_t n = 0; n < costs_.at.size(); ++n)
            total += Eigen::Map<const Eigen::VectorXf>(evidence_.data() + n * costs_.lattice(), lattice);
        Eigen::VectorXd result(lattice);
        for (Eigen::Index entry = 0; entry < lattice; ++entry)
            result[entry] = interpolated(total.data(), costs_.shift(static_cast<std::size_t>(entry)).cast<double>());
        return result;
    }

    /// −log odds of a motion against chance.
    [[nodiscard]] double of(const Eigen::Isometry3d& motion) const {
        const Eigen::Isometry3d back = motion.inverse();
        double sum = 0;
        for (Eigen::Index n = 0; n < places_.cols(); ++n)
            sum += interpolated(evidence_.data() + static_cast<std::size_t>(n) * costs_.lattice(),
                                along_ * (places_.col(n) - back * places_.col(n)));
        return sum;
    }

private:
    const EchoCosts& costs_;
    Eigen::Matrix3d along_;        // axes of the lattice, in steps
    std::vector<float> evidence_;  // of each shift of each place
    Eigen::Matrix3Xd places_;

    static void add_evidence(const float* cost, std::size_t lattice, double independent, float* evidence) {
        constexpr double least_cost = 1e-3;
        double sum = 0;
        int count = 0;
        for (std::size_t entry = 0; entry < lattice; ++entry)
            if (std::isfinite(cost[entry])) {
                sum += std::log(std::max<double>(cost[entry], least_cost));
                ++count;
            }
        const double chance = count > 0 ? sum / count : 0;
        for (std::size_t entry = 0; entry < lattice; ++entry)
            evidence[entry] = !std::isfinite(cost[entry])
                                  ? 0.F
                                  : static_cast<float>(0.5 * independent *
                                                       (std::log(std::max<double>(cost[entry], least_cost)) - chance));
    }

    /// By quadratic B-splines: between the steps of a linear interpolation there are no minima. Beyond the lattice
    /// nothing is known.
    [[nodiscard]] double interpolated(const float* evidence, const Eigen::Vector3d& shift) const {
        const int side = costs_.side();
        std::array<int, 3> low{};
        std::array<std::array<double, 3>, 3> weight{};
        for (std::size_t a = 0; a < 3; ++a) {
            const double x = shift[static_cast<Eigen::Index>(a)] + costs_.reach, middle = std::round(x), t = x - middle;
            if (!(middle >= 1 && middle <= side - 2)) return 0;
            low[a] = static_cast<int>(middle) - 1;
            weight[a] = {0.5 * (0.5 - t) * (0.5 - t), 0.75 - t * t, 0.5 * (0.5 + t) * (0.5 + t)};
        }
        const float* e = evidence + low[0] + side * (low[1] + side * low[2]);
        double sum = 0;
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t j = 0; j < 3; ++j, e += side) {
                sum += weight[2][k] * weight[1][j] * (weight[0][0] * e[0] + weight[0][1] * e[1] + weight[0][2] * e[2]);
                if (j == 2) e += side * (side - 3);
            }
        return sum;
    }
};

class PoseEvidence {
public:
    /// The kinds outlive this.
    PoseEvidence(const std::vector<KindEvidence>& kinds, std::vector<double> weights, const EchoPoseOptions& options)
        : kinds_(kinds), weights_(std::move(weights)), options_(options) {
        centre_ = places().rowwise().mean();
        radius_ = std::max(1.0, std::sqrt((places().colwise() - centre_).colwise().squaredNorm().mean()));
    }

    [[nodiscard]] double radius() const { return radius_; }

    /// −log posterior of a pose, 0 by chance where the headers put the organ.
    [[nodiscard]] double operator()(const Pose& pose) const {
        const Eigen::Isometry3d moved = motion(pose);
        double sum = expectation(pose);
        for (std::size_t n = 0; n < kinds_.size(); ++n) sum += weights_[n] * kinds_[n].of(moved);
        return sum;
    }

    [[nodiscard]] Eigen::Isometry3d motion(const Pose& pose) const {
        const Eigen::Vector3d rotation = Eigen::Vector3d(pose[3], pose[4], pose[5]) / radius_;
        const double angle = rotation.norm();
        Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
        if (angle > 0) result.linear() = Eigen::AngleAxisd(angle, rotation / angle).toRotationMatrix();
        result.translation() = centre_ + Eigen::Vector3d(pose[0], pose[1], pose[2]) - result.linear() * centre_;
        return result;
    }

    /// Mean over the places.
    [[nodiscard]] double distance(const Pose& a, const Pose& b) const {
        return (motion(a) * places() - motion(b) * places()).colwise().norm().mean();
    }

    /// The shifts that are lower than their neighbours, the lowest first.
    [[nodiscard]] std::vector<Pose> lowest_shifts() const {
        const EchoCosts& first = kinds_.front().costs();
        const std::size_t lattice = first.lattice();
        std::vector<Pose> shifts(lattice);
        Eigen::VectorXd costs(static_cast<Eigen::Index>(lattice));
        for (std::size_t entry = 0; entry < lattice; ++entry) {
            const Eigen::Vector3d shift = first.places.direction * (first.step_mm * first.shift(entry).cast<double>());
            shifts[entry] = {shift[0], shift[1], shift[2], 0, 0, 0};
            costs[static_cast<Eigen::Index>(entry)] = expectation(shifts[entry]);
        }
        for (std::size_t n = 0; n < kinds_.size(); ++n) costs += weights_[n] * kinds_[n].of_shifts();
        std::vector<Eigen::Index> order(lattice);
        std::iota(order.begin(), order.end(), Eigen::Index{0});
        std::sort(order.begin(), order.end(), [&](auto a, auto b) { return costs[a] < costs[b]; });
        std::vector<Pose> result;
        for (const Eigen::Index entry : order) {
            const Pose& shift = shifts[static_cast<std::size_t>(entry)];
            const bool alone = std::none_of(result.begin(), result.end(), [&](const Pose& other) {
                return distance(other, shift) < 1.5 * first.step_mm;
            });
            if (alone) result.push_back(shift);
            if (static_cast<int>(result.size()) == options_.starts) break;
        }
        return result;
    }

private:
    const std::vector<KindEvidence>& kinds_;
    const std::vector<double> weights_;
    const EchoPoseOptions& options_;
    Eigen::Vector3d centre_;
    double radius_ = 1;  // of the places, mm

    [[nodiscard]] const Eigen::Matrix3Xd& places() const { return kinds_.front().places(); }

    [[nodiscard]] double expectation(const Pose& pose) const {
        const double shift = std::hypot(pose[0], pose[1], pose[2]) / options_.shift_mm,
                     turn = std::hypot(pose[3], pose[4], pose[5]) / radius_ / (options_.turn_deg * EIGEN_PI / 180);
        return 0.5 * (shift * shift + turn * turn);
    }
};

struct Found {
    Pose pose{};
    double cost = 0;
};

Found descended(const PoseEvidence& evidence, const Pose& start, const EchoPoseOptions& options) {
    nlopt::opt search(nlopt::LN_BOBYQA, 6);
    const auto objective = [](unsigned, const double* x, double*, void* data) {
        Pose pose;
        std::copy(x, x + 6, pose.begin());
        return (*static_cast<const PoseEvidence*>(data))(pose);
    };
    search.set_min_objective(objective, const_cast<PoseEvidence*>(&evidence));  // NLopt takes mutable data
    const double turn = options.most_deg * EIGEN_PI / 180 * evidence.radius();
    std::vector<double> bound{options.most_mm, options.most_mm, options.most_mm, turn, turn, turn}, low = bound;
    for (double& b : low) b = -b;
    search.set_lower_bounds(low);
    search.set_upper_bounds(bound);
    constexpr double first_step_mm = 2, tolerance_mm = 0.02;
    std::vector<double> step;
    for (const double b : bound) step.push_back(std::min(first_step_mm, 0.5 * b));  // BOBYQA needs room for two
    search.set_initial_step(step);
    search.set_xtol_abs(tolerance_mm);
    search.set_maxeval(options.evaluations);
    std::vector<double> x(start.begin(), start.end());
    for (std::size_t a = 0; a < x.size(); ++a) x[a] = std::clamp(x[a], low[a], bound[a]);
    Found found;
    try {
        search.optimize(x, found.cost);
    } catch (const nlopt::roundoff_limited&) {
        // The best point so far is in x.
    }
    std::copy(x.begin(), x.end(), found.pose.begin());
    found.cost = evidence(found.pose);
    return found;
}

}  // namespace

EchoPose echo_pose(const std::vector<PoseCosts>& kinds, const EchoPoseOptions& options, Observer& observer) {
    EchoPose result;
    if (kinds.front().costs.at.empty()) return result;
    std::vector<KindEvidence> of_kinds;
    std::vector<double> weights, finer_weights;
    for (const PoseCosts& kind : kinds) {
        of_kinds.emplace_back(kind.costs, options.independent_mm3);
        weights.push_back(kind.weight);
        finer_weights.push_back(kind.finer_weight);
    }
    const PoseEvidence evidence(of_kinds, weights, options), finer(of_kinds, finer_weights, options);
    std::vector<Pose> starts = evidence.lowest_shifts();
    const std::size_t turned = std::min(starts.size(), static_cast<std::size_t>(options.turned_starts));
    for (std::size_t n = 0; n < turned; ++n)
        for (std::size_t axis = 3; axis < 6; ++axis)
            for (const double sign : {-1.0, 1.0}) {
                Pose start = starts[n];
                start[axis] = sign * options.start_turn_deg * EIGEN_PI / 180 * evidence.radius();
                starts.push_back(start);
            }
    starts.push_back(Pose{});
    std::vector<Found> found(starts.size());
    tbb::parallel_for(std::size_t{0}, starts.size(),
                      [&](std::size_t n) { found[n] = descended(evidence, starts[n], options); });
    observer.checkpoint("rigid alignment", 1.0);
    std::stable_sort(found.begin(), found.end(), [](const Found& a, const Found& b) { return a.cost < b.cost; });
    result.motion = finer.motion(descended(finer, found.front().pose, options).pose);
    result.support = -found.front().cost;
    for (const Found& other : found) {
        const double away = evidence.distance(other.pose, found.front().pose);
        if (away < options.rival_mm) continue;
        result.rival_mm = away;
        result.rival_support = -other.cost;
        break;
    }
    return result;
}

}  // namespace tissuewarp::registration::detail
