#include "registration/detail/image_evidence.hpp"

#include "registration/detail/ground.hpp"
#include "registration/detail/least_trimmed_motion.hpp"
#include "registration/detail/near_points.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <functional>

namespace tissuewarp::registration::detail {

namespace {

double median_distance(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to) {
    Eigen::VectorXd distances = (to - from).colwise().norm();
    const auto middle = distances.begin() + distances.size() / 2;
    std::nth_element(distances.begin(), middle, distances.end());
    return *middle;
}

}  // namespace

ImageEvidence::ImageEvidence(const PreparedModel& prepared, const imaging::Volume& fixed, const ImageOptions& options,
                             ImageTools& tools, double energy)
    : prepared_(prepared),
      fixed_(fixed, tools.memory, [&](const imaging::Volume& image) { tools.engine->begin_fixed(image); }),
      options_(options),
      view_(fixed_.seen),
      locator_(tools.locator),
      energy_(energy),
      engine_(*tools.engine),
      dense_(prepared, engine_) {
    engine_.finish_fixed(fixed_);
}

int ImageEvidence::searches() const {
    return 1 + static_cast<int>(options_.dense_coarsening.size());
}

void ImageEvidence::search(const State& state, Observer& observer) {
    if (searches_done_ == 0) {
        blocks_ = located(consistent_matches(block_search(state, observer), options_.consistency));
        use(blocks_);
    } else {
        const std::vector<int>& grids = options_.dense_coarsening;
        const int coarsening = grids.at(std::min(static_cast<std::size_t>(searches_done_), grids.size()) - 1);
        DenseMatches dense = dense_.matches(state, coarsening, blocks_, locator_);
        use(std::move(dense.found));
        if (coarsening == last_coarsening_) gain_ = dense.agreement - *agreement_;
        last_coarsening_ = coarsening;
        agreement_ = dense.agreement;
    }
    ++searches_done_;
}

std::vector<BlockMatch> ImageEvidence::block_search(const State& state, Observer& observer) const {
    const MatchingTemplate& blocks = prepared_.image->blocks;
    BlockMatchingOptions matching = options_.matching;
    matching.rotation = state.placement.linear();
    matching.finest = FinestGrid::UndescribedPoints;
    return search_blocks(blocks, fixed_.image.geometry, engine_.blocks(), deformed(blocks.points(), state), matching,
                         observer);
}

Eigen::Matrix3Xd ImageEvidence::deformed(const Eigen::Matrix3Xd& points, const State& state) const {
    if (state.displacement.isZero(0)) return state.placement * points;
    Eigen::Matrix3Xd result = points;
    tbb::parallel_for(Eigen::Index{0}, points.cols(), [&](Eigen::Index n) {
        if (const auto at = locate_near(locator_, points.col(n)))
            result.col(n) += displacement_at(prepared_.model.mesh, state.displacement, *at);
    });
    return state.placement * result;
}

void ImageEvidence::use(LocatedMatches matches) {
    matches_ = std::move(matches);
    strongest_.resize(matches_.matches.size());
    tbb::parallel_for(std::size_t{0}, strongest_.size(), [&](std::size_t n) {
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
        axes.computeDirect(matches_.matches[n].information, Eigen::EigenvaluesOnly);
        strongest_[n] = axes.eigenvalues()[2];
    });
    shares_ = NodalShares(prepared_.model.mesh, matches_.places);
}

LocatedMatches ImageEvidence::located(const std::vector<BlockMatch>& matches) const {
    std::vector<std::optional<meshing::Location>> places(matches.size());
    tbb::parallel_for(std::size_t{0}, matches.size(),
                      [&](std::size_t n) { places[n] = locate_near(locator_, matches[n].moving); });
    LocatedMatches result;
    result.reserve(matches.size());
    for (std::size_t n = 0; n < matches.size(); ++n)
        if (places[n]) result.add(matches[n], *places[n]);
    return result;
}

Eigen::Isometry3d ImageEvidence::rigid_motion() const {
    constexpr std::size_t fewest = 10;
    if (matches_.matches.size() < fewest)
        throw InvalidInput("only " + std::to_string(matches_.matches.size()) +
                           " blocks of the moving image were found in the fixed one; check that they show the same "
                           "organ, and bring them within the search range of each other");
    const auto count = static_cast<Eigen::Index>(matches_.matches.size());
    Eigen::Matrix3Xd moving(3, count), fixed(3, count);
    for (Eigen::Index n = 0; n < count; ++n) {
        moving.col(n) = matches_.matches[static_cast<std::size_t>(n)].moving;
        fixed.col(n) = matches_.matches[static_cast<std::size_t>(n)].fixed;
    }
    if (view_share() < 0.9 && median_distance(moving, fixed) < options_.headers_within_mm)
        return Eigen::Isometry3d::Identity();
    return least_trimmed_motion(moving, fixed);
}

bool ImageEvidence::in_view(const Eigen::Vector3d& point) const {
    constexpr double margin_mm = 10;  // tissue may have come from outside of what is shown now
    return view_.distance(point) < margin_mm;
}

std::vector<char> ImageEvidence::surface_in_view(const Eigen::Isometry3d& placement) const {
    const std::vector<InterfaceNode>& interfaces = prepared_.interfaces.nodes();
    std::vector<char> result(static_cast<std::size_t>(prepared_.model.mesh.node_count()));
    tbb::parallel_for(std::size_t{0}, interfaces.size(), [&](std::size_t n) {
        const int node = interfaces[n].node;
        if (interfaces[n].outer != 0) return;
        result[static_cast<std::size_t>(node)] =
            in_view(placement * Eigen::Vector3d(prepared_.model.mesh.nodes.col(node)));
    });
    return result;
}

double ImageEvidence::view_share() const {
    double all = 0, seen = 0;
    const std::vector<char> shown = surface_in_view(Eigen::Isometry3d::Identity());
    for (const InterfaceNode& node : prepared_.interfaces.nodes()) {
        if (node.outer != 0) continue;
        all += node.area;
        if (shown[static_cast<std::size_t>(node.node)]) seen += node.area;
    }
    return all > 0 ? seen / all : 0;
}

ImageFit ImageEvidence::fit(const State& state) {
    constexpr double near_mm = 15;
    const Eigen::Matrix3Xd& nodes = prepared_.model.mesh.nodes;
    ImageFit fit;
    fit.blocks = static_cast<int>(prepared_.image->blocks.points().cols());
    fit.matched = static_cast<int>(blocks_.matches.size());
    std::vector<Eigen::Vector3d> places;
    places.reserve(matches_.matches.size());
    for (const BlockMatch& match : matches_.matches) places.push_back(match.moving);
    const NearPoints matched(std::move(places), near_mm);
    const auto shown = tbb::parallel_reduce(
        tbb::blocked_range<Eigen::Index>(0, nodes.cols()), Eigen::Index{0},
        [&](const tbb::blocked_range<Eigen::Index>& range, Eigen::Index count) {
            for (Eigen::Index node = range.begin(); node < range.end(); ++node)
                count += matched.any_about(nodes.col(node));
            return count;
        },
        std::plus<>());
    fit.shown_share = double(shown) / double(nodes.cols());
    fit.residual_mm = mean_residual(pulled(state));
    fit.agreement = agreement_;
    return fit;
}

const std::vector<ImageEvidence::PulledMatch>& ImageEvidence::pulled(const State& state) {
    const Eigen::Isometry3d back = state.placement.inverse();
    pulled_.resize(matches_.matches.size());
    tbb::parallel_for(std::size_t{0}, pulled_.size(), [&](std::size_t n) {
        const BlockMatch& match = matches_.matches[n];
        const meshing::Location& place = matches_.places[n];
        const Eigen::Matrix3d information = back.linear() * match.information * back.linear().transpose();
        const Eigen::Vector3d target = back * match.fixed - match.moving,
                              e = target - displacement_at(prepared_.model.mesh, state.displacement, place),
                              force = information * e;
        pulled_[n] = {{information, force}, match.confidence, std::sqrt(e.dot(force) / strongest_[n])};
    });
    return pulled_;
}

double ImageEvidence::mean_residual(const std::vector<PulledMatch>& matches) {
    double sum = 0, weights = 0;
    for (const PulledMatch& match : matches) {
        sum += match.confidence * match.residual_mm;
        weights += match.confidence;
    }
    return weights > 0 ? sum / weights : 0;
}

Contribution ImageEvidence::contribution(const RoundPlan& plan, const State& state) {
    const std::vector<PulledMatch>& matches = pulled(state);
    forces_.resize(matches.size());
    tbb::parallel_for(std::size_t{0}, matches.size(), [&](std::size_t n) {
        const double weight = energy_ * matches[n].confidence * robust_weight(matches[n].residual_mm, plan.scale_mm);
        forces_[n] = {weight * matches[n].pull.stiffness, weight * matches[n].pull.force};
    });
    Contribution result;
    result.candidates =
        std::max(static_cast<int>(prepared_.image->blocks.points().cols()), static_cast<int>(matches.size()));
    result.matched = static_cast<int>(matches.size());
    result.mean_residual_mm = mean_residual(matches);
    result.conditions.springs = lumped_springs(shares_, forces_, state.displacement);
    for (const tled::Spring& spring : ground(state.placement)) result.conditions.springs.push_back(spring);
    return result;
}

const std::vector<tled::Spring>& ImageEvidence::ground(const Eigen::Isometry3d& placement) {
    if (ground_.empty() || !ground_at_.isApprox(placement, 0)) {
        ground_at_ = placement;
        const std::vector<char> shown = surface_in_view(placement);
        ground_ = ground_springs(prepared_, energy_, [&](const InterfaceNode& node) {
            return shown[static_cast<std::size_t>(node.node)]
                       ? ExpectedMotion(options_.expected_motion_mm)
                       : ExpectedMotion(options_.unseen_motion_mm, options_.unseen_slide_mm);
        });
    }
    return ground_;
}

}  // namespace tissuewarp::registration::detail
