#include "registration/matching/blocks/block_search.hpp"
#include "registration/matching/blocks/cost_minimum.hpp"
#include "registration/matching/blocks/squared_differences.hpp"
#include "registration/matching/consistency/local_affine.hpp"
#include "registration/matching/descriptors/matching_grid.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>

namespace tissuewarp::registration {

using detail::as_vector;
using detail::BlockSight;
using detail::CostLattice;
using detail::FixedBlocks;
using detail::MatchingImage;
using detail::Minimum;
using detail::minimum_of;
using detail::SoughtBlock;
using detail::Voxel;
using imaging::Volume;

namespace {

constexpr detail::BlockInformationRules rules;
constexpr int least_searched = rules.least_searched;
constexpr double independent_share = rules.independent_share, least_deviation = rules.least_deviation;

Voxel nearest_voxel(const imaging::Geometry& grid, const Eigen::Vector3d& point) {
    const Eigen::Vector3d index = grid.index(point);
    Voxel voxel;
    for (std::size_t a = 0; a < 3; ++a) {
        const double rounded = std::round(index[static_cast<Eigen::Index>(a)]);
        voxel[a] = static_cast<int>(std::clamp(rounded, -1e6, 1e6));  // far off any grid stays far off
    }
    return voxel;
}

/// Error (voxels) of the way back, along what the block shows: it should lead to where the first block lay.
double back_error(const Minimum& back, const Voxel& block, const Minimum& forward) {
    const Eigen::Vector3d error = back.index() - as_vector(block) + forward.fit.minimum;
    return std::sqrt(error.dot(forward.fit.hessian * error) / forward.fit.largest_curvature);
}

/// Inverse covariance of a match, 1/mm²: least squares of N independent residuals of variance c about the minimum has
/// the covariance 2 c/(N H), H the Hessian of the mean square. Two things are taken off first. Chance: the minimum was
/// chosen among places whose mean squares scatter by c √(2/N), which alone looks like a curvature of some three times
/// that at the lowest of them. Leakage: a parabola fitted to the cost of a plane edge, which is none, curves along the
/// edge too. What interpolation leaves is added to the covariance.
Eigen::Matrix3d information(const Minimum& minimum, const imaging::Geometry& grid, int radius) {
    const double independent = independent_share * std::pow(2 * radius + 1, 3), h = grid.spacing[0];
    const double chance = rules.chance * std::sqrt(2 * independent);
    const Eigen::Matrix3d raw = independent / (2 * std::max(minimum.cost, 1e-6)) * minimum.fit.hessian;
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
    axes.computeDirect(raw);
    const double leakage = rules.leakage * axes.eigenvalues()[2];
    const Eigen::Array3d strength = (axes.eigenvalues().array() - chance - leakage).max(0.0);
    const Eigen::Vector3d bounded = strength / (1 + strength * least_deviation * least_deviation) / (h * h);
    const Eigen::Matrix3d turn = grid.direction * axes.eigenvectors();
    return turn * bounded.asDiagonal() * turn.transpose();
}

struct Level {
    const MatchingImage& moving;
    imaging::Geometry grid;  // of the fixed image
    std::unique_ptr<FixedBlocks> fixed;
    int reach;
    std::vector<std::size_t> searched, left_out;  // points
};

/// Mean inverse standard deviation of the blocks that were searched, 1/mm; those not found count as 0.
double mean_certainty(const std::vector<BlockMatch>& matches, const std::vector<std::size_t>& searched) {
    double total = 0;
    for (const std::size_t n : searched)
        total += std::pow(std::max(matches[n].information.determinant(), 0.0), 1.0 / 6);
    return total / double(searched.size());
}

/// Points by cubes of 16 mm: those searched one after the other find the image in the cache.
std::vector<std::size_t> near_after_near(const Eigen::Matrix3Xd& points) {
    constexpr double cube_mm = 16;
    constexpr unsigned bits = 21;  // of a cube's number along an axis: farther off all lie in one
    std::vector<std::pair<std::uint64_t, std::size_t>> cubes(static_cast<std::size_t>(points.cols()));
    for (std::size_t n = 0; n < cubes.size(); ++n) {
        const Eigen::Array3d cube = (points.col(static_cast<Eigen::Index>(n)).array() / cube_mm).floor();
        std::uint64_t key = 0;
        for (const Eigen::Index axis : {2, 1, 0}) {
            constexpr double most = 1U << (bits - 1);
            key = key << bits | static_cast<std::uint64_t>(std::clamp(cube[axis] + most, 0.0, 2 * most - 1));
        }
        cubes[n] = {key, n};
    }
    std::sort(cubes.begin(), cubes.end());
    std::vector<std::size_t> order(cubes.size());
    std::transform(cubes.begin(), cubes.end(), order.begin(), [](const auto& cube) { return cube.second; });
    return order;
}

/// The whole search: the template's points that may be seen, and where they are expected.
class BlockSearch {
public:
    BlockSearch(const detail::TemplateImages& moving, detail::BlockEngine& engine, const Eigen::Matrix3Xd& points,
                const Eigen::Matrix3Xd& predicted, const BlockMatchingOptions& options)
        : moving_(moving),
          engine_(engine),
          points_(points),
          predicted_(predicted),
          options_(options),
          order_(near_after_near(points)) {}

    std::vector<BlockMatch> run(Observer& observer) {
        std::optional<Level> best_level;
        std::vector<BlockMatch> best;
        double certainty = -1;
        const int levels = moving_.options.levels;
        const bool all = options_.finest == FinestGrid::AllPoints;
        const int whole = all ? levels : std::max(levels - 1, options_.skipped_levels + 1);
        for (int n = options_.skipped_levels; n < whole; ++n) {
            Level level = prepare(n, order_);
            std::vector<BlockMatch> matches(order_.size());
            const bool last_of_all = n + 1 == whole;
            Prediction next;
            match(level, level.searched, matches, [&] {
                if (n + 1 < levels) next = prediction(level, last_of_all ? sought_later(level) : order_);
            });
            const double found = mean_certainty(matches, level.searched);
            if (n + 1 < levels && last_of_all && found < certainty) next = prediction(level, sought_later(*best_level));
            predict(matches, next);
            if (found >= certainty) {
                certainty = found;
                best = std::move(matches);
                best_level.emplace(std::move(level));
            }
            observer.checkpoint("block matching", double(n + 1) / levels);
        }
        match(*best_level, best_level->left_out, best);
        if (whole < levels) search_undescribed(best);
        std::erase_if(best, [](const BlockMatch& match) { return match.point < 0 || match.information.trace() <= 0; });
        return best;
    }

private:
    const detail::TemplateImages& moving_;
    detail::BlockEngine& engine_;
    const Eigen::Matrix3Xd& points_;
    Eigen::Matrix3Xd predicted_;
    const BlockMatchingOptions& options_;
    const ConsistencyOptions story_{};  // what neighbours must agree on, between levels as afterwards
    std::vector<std::size_t> order_;

    /// Points between the described tissue and the border of what the moving image shows.
    [[nodiscard]] std::vector<std::size_t> undescribed() const {
        const MatchingImage& finest = moving_.levels.back();
        std::vector<char> described(order_.size());
        tbb::parallel_for(std::size_t{0}, described.size(), [&](std::size_t n) {
            const Voxel centre = nearest_voxel(finest.grid, points_.col(static_cast<Eigen::Index>(n)));
            described[n] = finest.seen[static_cast<std::size_t>(finest.offset(centre))] != 0;
        });
        std::vector<std::size_t> points;
        std::copy_if(order_.begin(), order_.end(), std::back_inserter(points),
                     [&](std::size_t n) { return !described[n]; });
        return points;
    }

    /// Points that are looked for after the last level that looks for all.
    [[nodiscard]] std::vector<std::size_t> sought_later(const Level& best) const {
        std::vector<std::size_t> points = undescribed();
        points.insert(points.end(), best.left_out.begin(), best.left_out.end());
        std::sort(points.begin(), points.end());
        points.erase(std::unique(points.begin(), points.end()), points.end());
        return points;
    }

    /// The finest grid's matches take the place of coarser ones where that grid serves the points better.
    void search_undescribed(std::vector<BlockMatch>& best) const {
        const std::vector<std::size_t> points = undescribed();
        if (points.empty()) return;
        const Level level = prepare(moving_.options.levels - 1, points);
        std::vector<BlockMatch> matches(best.size());
        match(level, points, matches);
        if (mean_certainty(matches, points) < mean_certainty(best, points)) return;
        for (const std::size_t n : points) best[n] = matches[n];
    }

    /// The fixed image about the points, along the axes of the moving grid, turned: descriptors depend on the
    /// direction.
    [[nodiscard]] Level prepare(int level, const std::vector<std::size_t>& points) const {
        const MatchingImage& moving = moving_.levels[static_cast<std::size_t>(level)];
        const double spacing = moving.grid.spacing[0];
        const bool first = level == options_.skipped_levels;
        const int reach = first ? static_cast<int>(std::ceil(options_.search_mm / spacing)) : detail::refinement_reach;
        const int most = (detail::most_row_voxels - 1) / 2 - moving_.options.block_radius - 1;
        if (reach > most)
            throw InvalidInput("block matching: a search of " + std::to_string(options_.search_mm) + " mm is " +
                               std::to_string(reach) + " voxels of the first level, more than " + std::to_string(most) +
                               "; take more levels or a coarser grid");
        const int margin = detail::search_margin(reach, moving_.options.block_radius);
        const Eigen::Matrix3Xd predicted = predicted_(Eigen::all, points);
        const imaging::Geometry grid =
            detail::grid_about(predicted, options_.rotation * moving.grid.direction, spacing, margin * spacing);
        const detail::SearchRegion region(grid, predicted, margin);
        Level result{moving, grid, engine_.fixed_on(grid, region, static_cast<std::size_t>(level)), reach, {}, {}};
        // Blocks of a coarse grid overlap so much that some tell the story of all.
        const std::size_t coarser = std::size_t{1} << (moving_.options.levels - 1 - level);
        const std::size_t step = std::clamp(points.size() / least_searched, std::size_t{1}, coarser);
        for (std::size_t place = 0; place < points.size(); ++place)
            (place % step == 0 ? result.searched : result.left_out).push_back(points[place]);
        return result;
    }

    /// Fills in the entries of some points; `point` stays −1 where the block was not found.
    void match(
        const Level& level, const std::vector<std::size_t>& points, std::vector<BlockMatch>& matches,
        const std::function<void()>& meanwhile = [] {}) const {
        std::vector<SoughtBlock> blocks(points.size());
        tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t place) {
            blocks[place] = sought(level, static_cast<Eigen::Index>(points[place]));
        });
        const auto visit = [&](std::size_t place, const BlockSight& sight) {
            const auto found = match_of(level, blocks[place].moving, sight);
            if (!found) return;
            matches[points[place]] = *found;
            matches[points[place]].point = static_cast<int>(points[place]);
        };
        level.fixed->look(blocks, level.reach, options_.least_share, visit, meanwhile);
    }

    /// The block about a point of the template, and where it is expected.
    [[nodiscard]] SoughtBlock sought(const Level& level, Eigen::Index n) const {
        const Voxel centre = nearest_voxel(level.moving.grid, points_.col(n));
        const Eigen::Vector3d moving = level.moving.grid.point(as_vector(centre));
        const Eigen::Vector3d expected = predicted_.col(n) + options_.rotation * (moving - points_.col(n));
        return {centre, nearest_voxel(level.grid, expected)};
    }

    [[nodiscard]] std::optional<BlockMatch> match_of(const Level& level, const Voxel& block,
                                                     const BlockSight& sight) const {
        if (!sight.forward || !sight.back) return std::nullopt;
        const auto found = minimum_of(*sight.forward), back = minimum_of(*sight.back);
        if (!found || !back) return std::nullopt;
        const double error = back_error(*back, block, *found), scaled = error / options_.back_match_voxels;
        BlockMatch result;
        result.moving = level.moving.grid.point(as_vector(block));
        result.fixed = level.grid.point(found->index());
        result.cost = found->cost;
        result.uniqueness = detail::uniqueness(sight.first, *found);
        result.back_match_mm = error * level.grid.spacing[0];
        result.confidence = result.uniqueness * std::exp(-0.5 * scaled * scaled);
        result.information = information(*found, level.grid, moving_.options.block_radius);
        return result;
    }

    /// Points, and the nearest of those that a level searches.
    struct Prediction {
        std::vector<std::size_t> points;
        std::vector<std::vector<int>> neighbours;
    };

    [[nodiscard]] Prediction prediction(const Level& level, std::vector<std::size_t> points) const {
        auto neighbours = detail::nearest_neighbours(points_, std::vector<int>(points.begin(), points.end()),
                                                     std::vector<int>(level.searched.begin(), level.searched.end()),
                                                     story_.neighbours);
        return {std::move(points), std::move(neighbours)};
    }

    /// What is looked for next starts from what the searched neighbours of each point agree on.
    void predict(const std::vector<BlockMatch>& matches, const Prediction& next) {
        const auto& [points, neighbours] = next;
        if (points.empty()) return;
        detail::ScatteredMotion motion{points_, predicted_ - points_, std::vector<Eigen::Matrix3d>(matches.size())};
        tbb::parallel_for(std::size_t{0}, matches.size(), [&](std::size_t n) {
            const auto column = static_cast<Eigen::Index>(n);
            if (matches[n].point >= 0) motion.displacements.col(column) = matches[n].fixed - matches[n].moving;
            motion.weights[n] = detail::neighbour_weight(matches[n]);
        });
        const auto vouched = [&](const std::vector<int>& others) {
            return std::any_of(others.begin(), others.end(), [&](int other) {
                return motion.weights[static_cast<std::size_t>(other)].trace() > rules.least_voucher;
            });
        };
        const std::vector<detail::LocalMotion> found =
            detail::fit_local_affine(motion, points_(Eigen::all, points), neighbours, story_.trimmed_share);
        for (std::size_t n = 0; n < points.size(); ++n) {
            const auto column = static_cast<Eigen::Index>(points[n]);
            if (vouched(neighbours[n])) predicted_.col(column) = points_.col(column) + found[n].displacement;
        }
    }
};

void require_usable(const detail::TemplateImages& moving, const Eigen::Matrix3Xd& predicted,
                    const BlockMatchingOptions& options) {
    if (moving.points.cols() != predicted.cols())
        throw InvalidInput("block matching: " + std::to_string(moving.points.cols()) + " points and " +
                           std::to_string(predicted.cols()) + " predicted positions; give as many of both");
    if (!predicted.allFinite()) throw InvalidInput("block matching: a predicted position is not finite; give LPS mm");
    if (options.skipped_levels < 0 || options.skipped_levels >= moving.options.levels)
        throw InvalidInput("block matching: " + std::to_string(options.skipped_levels) + " levels skipped of " +
                           std::to_string(moving.options.levels) + "; leave one or more");
    const bool in_range = options.search_mm >= 0 && options.search_mm <= 1000 && options.back_match_voxels > 0 &&
                          options.least_share > 0 && options.least_share <= 1;
    if (!in_range)
        throw InvalidInput(
            "block matching: options out of range; search 0 to 1000 mm, back match above 0, least share above 0 and up "
            "to 1");
    if (!(options.rotation.transpose() * options.rotation).isIdentity(1e-6))
        throw InvalidInput("block matching: the rotation is not orthonormal; give the linear part of a rigid motion");
}

std::vector<int> in_both_images(const detail::TemplateImages& moving, const imaging::Geometry& fixed,
                                const Eigen::Matrix3Xd& predicted) {
    std::vector<char> in_both(static_cast<std::size_t>(predicted.cols()));
    tbb::parallel_for(Eigen::Index{0}, predicted.cols(), [&](Eigen::Index n) {
        in_both[static_cast<std::size_t>(n)] =
            detail::in_image(moving.image, moving.points.col(n)) && detail::in_image(fixed, predicted.col(n));
    });
    std::vector<int> result;
    for (std::size_t n = 0; n < in_both.size(); ++n)
        if (in_both[n]) result.push_back(static_cast<int>(n));
    if (result.empty())
        throw InvalidInput("block matching: none of " + std::to_string(predicted.cols()) +
                           " points is expected to lie in both images; align them first");
    return result;
}

}  // namespace

std::vector<BlockMatch> detail::search_blocks(const MatchingTemplate& moving, const imaging::Geometry& fixed,
                                              BlockEngine& engine, const Eigen::Matrix3Xd& predicted,
                                              const BlockMatchingOptions& options, Observer& observer) {
    const TemplateImages& images = moving.images();
    require_usable(images, predicted, options);
    const std::vector<int> usable = in_both_images(images, fixed, predicted);
    const Eigen::Matrix3Xd from = images.points(Eigen::all, usable), to = predicted(Eigen::all, usable);
    std::vector<BlockMatch> matches = BlockSearch(images, engine, from, to, options).run(observer);
    for (BlockMatch& match : matches) match.point = usable[static_cast<std::size_t>(match.point)];
    return matches;
}

std::vector<BlockMatch> match_blocks(const MatchingTemplate& moving, const Volume& fixed,
                                     const Eigen::Matrix3Xd& predicted, const BlockMatchingOptions& options,
                                     Observer& observer) {
    const detail::SeenImage seen(fixed);
    const auto engine = detail::make_cpu_block_engine(moving.images(), seen);
    return detail::search_blocks(moving, fixed.geometry, *engine, predicted, options, observer);
}

}  // namespace tissuewarp::registration
