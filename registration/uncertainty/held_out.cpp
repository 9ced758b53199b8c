#include "registration/uncertainty/held_out.hpp"

#include "core/errors.hpp"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

namespace tissuewarp::registration::detail {

using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

/// Of each datum the region it belongs to: that of the nearest of so many data, each the farthest from those before,
/// so that regions whose numbers follow each other lie apart. −1 where it does not pull.
std::vector<int> regions_of(const std::vector<PulledNode>& data, const Eigen::Matrix3Xd& nodes, int count) {
    std::vector<int> region(data.size(), -1);
    std::vector<double> distance(data.size(), std::numeric_limits<double>::infinity());
    for (int r = 0; r < count; ++r) {
        std::size_t farthest = data.size();
        for (std::size_t n = 0; n < data.size(); ++n) {
            if (!(data[n].spring.stiffness.trace() > 0)) continue;
            if (farthest == data.size() || distance[n] > distance[farthest]) farthest = n;
        }
        if (farthest == data.size() || !(distance[farthest] > 0)) break;
        const Vector3d centre = nodes.col(data[farthest].spring.node);
        for (std::size_t n = 0; n < data.size(); ++n) {
            if (!(data[n].spring.stiffness.trace() > 0)) continue;
            const double here = (nodes.col(data[n].spring.node) - centre).squaredNorm();
            if (here >= distance[n]) continue;
            distance[n] = here;
            region[n] = r;
        }
    }
    return region;
}

/// The pulls without the data of a fold.
LastPulls without_fold(const LastPulls& pulls, const std::vector<PulledNode>& kept) {
    LastPulls result = pulls;
    std::erase_if(result.springs, [](const PulledNode& pulled) { return pulled.origin == Origin::Datum; });
    result.springs.insert(result.springs.end(), kept.begin(), kept.end());
    return result;
}

/// What the springs of a region hold of displacements away from their targets as a whole, 3 × k: their mean, weighed as
/// they pull. Of single data it would be their noise.
struct Region {
    Eigen::Matrix3d stiffness = Eigen::Matrix3d::Zero();
    MatrixXd missed, expected;  ///< forces, 3 × 1 and 3 × k, mN

    void add(const tled::Spring& spring, const MatrixXd& away, const MatrixXd& expected_away) {
        stiffness += spring.stiffness;
        missed = missed.size() == 0 ? MatrixXd(spring.stiffness * away) : MatrixXd(missed + spring.stiffness * away);
        expected = expected.size() == 0 ? MatrixXd(spring.stiffness * expected_away)
                                        : MatrixXd(expected + spring.stiffness * expected_away);
    }
    /// Square of what was missed over its expectation.
    [[nodiscard]] std::optional<double> ratio() const {
        if (missed.size() == 0) return std::nullopt;
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(stiffness);
        const double least = 1e-3 * axes.eigenvalues()[2];  // along the surface labels say nothing
        const Eigen::Matrix3d flexibility =
            axes.eigenvectors() *
            (axes.eigenvalues().array() > least).select(axes.eigenvalues().cwiseInverse(), 0.0).matrix().asDiagonal() *
            axes.eigenvectors().transpose();
        const auto energy = [&](const MatrixXd& force) {
            return force.cwiseProduct(flexibility * force).sum() / double(force.cols());
        };
        const double expectation = energy(expected);
        if (!(expectation > 0)) return std::nullopt;
        return energy(missed) / expectation;
    }
};

struct Fold {
    std::vector<PulledNode> kept, left_out;
    DataErrors errors_of_kept, errors_of_left_out;
    std::vector<int> region;  // of those left out
};

Fold fold_of(int number, int folds, const std::vector<PulledNode>& data, const DataErrors& errors,
             const std::vector<int>& region) {
    Fold fold;
    for (std::size_t n = 0; n < data.size(); ++n) {
        const bool out = region[n] >= 0 && region[n] % folds == number;
        (out ? fold.left_out : fold.kept).push_back(data[n]);
        (out ? fold.errors_of_left_out : fold.errors_of_kept).push_back(errors[n]);
        if (out) fold.region.push_back(region[n]);
    }
    return fold;
}

// With r the residuals of the data left out, taking their springs away moves the tissue by −A₋⁻¹ K r: they are missed
// by r + A₋⁻¹ K r. To be expected is ε + u − û₋ of truths u and errors ε.
void add_fold(const Fold& fold, const LinearRegistration& rest, const Eigen::Matrix3Xd& displacement,
              const Truths& truths, std::vector<Region>& regions) {
    const auto nodes = static_cast<int>(displacement.cols());
    DataErrors residuals;
    for (const PulledNode& pulled : fold.left_out)
        residuals.emplace_back(pulled.spring.target - displacement.col(pulled.spring.node));
    const MatrixXd moved = rest.inverse(forces_of(fold.left_out, residuals, nodes)),
                   off = rest.missed(truths) - rest.inverse(forces_of(fold.kept, fold.errors_of_kept, nodes));
    for (std::size_t n = 0; n < fold.left_out.size(); ++n) {
        const tled::Spring& spring = fold.left_out[n].spring;
        regions[std::size_t(fold.region[n])].add(spring, residuals[n] + moved.middleRows<3>(3 * spring.node),
                                                 fold.errors_of_left_out[n] + off.middleRows<3>(3 * spring.node));
    }
}

}  // namespace

std::optional<HeldOut> held_out(const PreparedModel& prepared, const LastPulls& pulls, const LastPulls& unseen,
                                const Eigen::Matrix3Xd& displacement, const Truths& truths, const DataErrors& errors) {
    using Clock = std::chrono::steady_clock;
    const Clock::time_point begin = Clock::now();
    const auto& [count, folds, draws] = held_out_options;
    const std::vector<PulledNode> data = pulls.data();
    const std::vector<int> region = regions_of(data, prepared.model.mesh.nodes, count);
    if (data.empty() || *std::max_element(region.begin(), region.end()) + 1 < folds) return std::nullopt;
    std::vector<Region> regions(static_cast<std::size_t>(count));
    const auto leave_out = [&](int number) {
        const Fold fold = fold_of(number, folds, data, errors, region);
        try {
            const LinearRegistration rest(prepared, without_fold(pulls, fold.kept), unseen);
            add_fold(fold, rest, displacement, truths, regions);
        } catch (const InvalidInput&) {  // the rest holds the tissue no longer
        }
    };
    // Each has regions of its own, and a factor; isolated, so that no thread holds those of two.
    tbb::parallel_for(0, folds, [&](int number) { tbb::this_task_arena::isolate([&] { leave_out(number); }); });
    HeldOut result;
    double sum = 0;
    for (const Region& region_left_out : regions) {
        const auto ratio = region_left_out.ratio();
        if (!ratio) continue;
        ++result.regions;
        sum += *ratio;
    }
    if (result.regions == 0) return std::nullopt;
    result.z = std::sqrt(sum / result.regions);
    result.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    return result;
}

}  // namespace tissuewarp::registration::detail
