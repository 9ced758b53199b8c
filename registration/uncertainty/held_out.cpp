#include "registration/uncertainty/held_out.hpp"

#include "core/errors.hpp"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
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

/// Data, and the nodes that they pull at.
struct PulledNodes {
    std::vector<PulledNode> data;
    std::vector<int> nodes;           // ascending
    std::vector<Eigen::Index> place;  // of every datum's node: its first row in vectors of 3 rows a node

    explicit PulledNodes(std::vector<PulledNode> given) : data(std::move(given)) {
        for (const PulledNode& pulled : data) nodes.push_back(pulled.spring.node);
        std::sort(nodes.begin(), nodes.end());
        nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
        for (const PulledNode& pulled : data)
            place.push_back(3 * (std::lower_bound(nodes.begin(), nodes.end(), pulled.spring.node) - nodes.begin()));
    }
    [[nodiscard]] Eigen::Index rows() const { return static_cast<Eigen::Index>(3 * nodes.size()); }
};

struct Fold {
    std::vector<std::size_t> kept, left_out;  // data
};

Fold fold_of(int number, int folds, const std::vector<int>& region) {
    Fold fold;
    for (std::size_t n = 0; n < region.size(); ++n)
        (region[n] >= 0 && region[n] % folds == number ? fold.left_out : fold.kept).push_back(n);
    return fold;
}

/// A₋⁻¹ between the nodes of the data, forces to displacements: of the stiffness A without the springs of a fold.
using Flexibility = std::function<MatrixXd(const MatrixXd&)>;

/// From S, the inverse with all springs: (A − B)⁻¹ = (1 − S B)⁻¹ S between these nodes, B the springs left out
/// (Woodbury). Throws InvalidInput where the rest does not hold the tissue.
Flexibility taken_out(const Fold& fold, const PulledNodes& pulled, const MatrixXd& with_all) {
    MatrixXd middle = MatrixXd::Identity(pulled.rows(), pulled.rows());
    for (const std::size_t n : fold.left_out)
        middle.middleCols<3>(pulled.place[n]) -=
            with_all.middleCols<3>(pulled.place[n]) * pulled.data[n].spring.stiffness;
    constexpr double digits_left = 1e-10;
    const Eigen::PartialPivLU<MatrixXd> factor(middle);
    if (!(factor.rcond() > digits_left)) throw InvalidInput("the data that are left hold the tissue no longer");
    return
        [between = MatrixXd(factor.solve(with_all))](const MatrixXd& forces) -> MatrixXd { return between * forces; };
}

/// The slow twin: a factor without the springs.
Flexibility refactored(const Fold& fold, const PulledNodes& pulled, const PreparedModel& prepared,
                       const LastPulls& pulls, const LoadedPosterior& all) {
    std::vector<PulledNode> kept;
    for (const std::size_t n : fold.kept) kept.push_back(pulled.data[n]);
    const auto rest =
        std::make_shared<const LoadedPosterior>(Posterior(prepared, with_data(without_fold(pulls, kept))), all.loads());
    std::vector<Eigen::Index> rows;
    for (const int node : pulled.nodes)
        for (int c = 0; c < 3; ++c) rows.push_back(3 * Eigen::Index{node} + c);
    return [rest, rows, all = 3 * Eigen::Index{prepared.rest.node_count}](const MatrixXd& forces) -> MatrixXd {
        MatrixXd spread = MatrixXd::Zero(all, forces.cols());
        spread(rows, Eigen::all) = forces;
        return rest->inverse(spread)(rows, Eigen::all);
    };
}

// With r the residuals of the data left out, taking their springs away moves the tissue by −A₋⁻¹ K r: they are missed
// by r + A₋⁻¹ K r. To be expected is ε + u − û₋ of truths u and errors ε, where û₋ = A₋⁻¹ K₋ (u + ε) of the data kept.
void add_fold(const Fold& fold, const PulledNodes& pulled, const Flexibility& rest,
              const Eigen::Matrix3Xd& displacement, const MatrixXd& truths, const DataErrors& errors,
              const std::vector<int>& region, std::vector<Region>& regions) {
    const auto true_at = [&](std::size_t n) { return truths.middleRows<3>(3 * pulled.data[n].spring.node); };
    const auto residual = [&](std::size_t n) -> Eigen::Vector3d {
        return pulled.data[n].spring.target - displacement.col(pulled.data[n].spring.node);
    };
    MatrixXd forces = MatrixXd::Zero(pulled.rows(), 1 + truths.cols());
    for (const std::size_t n : fold.left_out)
        forces.col(0).segment<3>(pulled.place[n]) += pulled.data[n].spring.stiffness * residual(n);
    for (const std::size_t n : fold.kept)
        forces.block(pulled.place[n], 1, 3, truths.cols()) +=
            pulled.data[n].spring.stiffness * (true_at(n) + errors[n]);
    const MatrixXd moved = rest(forces);
    for (const std::size_t n : fold.left_out) {
        const auto here = moved.middleRows<3>(pulled.place[n]);
        regions[std::size_t(region[n])].add(pulled.data[n].spring, residual(n) + here.col(0),
                                            errors[n] + true_at(n) - here.rightCols(truths.cols()));
    }
}

}  // namespace

std::optional<HeldOut> held_out(const PreparedModel& prepared, const LastPulls& pulls, const LoadedPosterior& all,
                                const Eigen::Matrix3Xd& displacement, const MatrixXd& truths, const DataErrors& errors,
                                const HeldOutOptions& options) {
    using Clock = std::chrono::steady_clock;
    const Clock::time_point begin = Clock::now();
    const PulledNodes pulled(pulls.data());
    const std::vector<int> region = regions_of(pulled.data, prepared.model.mesh.nodes, options.regions);
    if (region.empty() || *std::max_element(region.begin(), region.end()) + 1 < options.folds) return std::nullopt;
    // Data that tell where the prior moves to are gone from there too: another stiffness.
    const bool between = pulls.prior_moves != PriorMoves::WithData &&
                         static_cast<int>(pulled.nodes.size()) <= options.most_nodes_between;
    const MatrixXd with_all = between ? all.inverse_between(pulled.nodes) : MatrixXd();
    std::vector<Region> regions(static_cast<std::size_t>(options.regions));
    const auto leave_out = [&](int number) {
        const Fold fold = fold_of(number, options.folds, region);
        try {
            const Flexibility rest =
                between ? taken_out(fold, pulled, with_all) : refactored(fold, pulled, prepared, pulls, all);
            add_fold(fold, pulled, rest, displacement, truths, errors, region, regions);
        } catch (const InvalidInput&) {  // the rest holds the tissue no longer
        }
    };
    // Each has regions of its own, and a factor; isolated, so that no thread holds those of two.
    tbb::parallel_for(0, options.folds, [&](int number) { tbb::this_task_arena::isolate([&] { leave_out(number); }); });
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
