#include "registration/terms/image.hpp"

#include "meshing/search/point_tree.hpp"
#include "registration/doubts.hpp"
#include "registration/matching/image_matching.hpp"
#include "registration/pose/least_trimmed_motion.hpp"
#include "registration/pose/turned_image.hpp"
#include "registration/resection/tissue_gone.hpp"
#include "registration/terms/view_prior.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

/// Of RoundPlan::most_step_mm: how far a match may pull at once. Matches found together move tissue together, so that
/// it is far until an equilibrium fails and the step is halved. Chosen by hand, on a lung that was torn.
constexpr double most_image_steps = 4;

double median_distance(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to) {
    Eigen::VectorXd distances = (to - from).colwise().norm();
    const auto middle = distances.begin() + distances.size() / 2;
    std::nth_element(distances.begin(), middle, distances.end());
    return *middle;
}

void leave_out_beside_sliding(const PreparedModel& prepared, LocatedMatches& located) {
    const meshing::PointTree sliding(prepared.interfaces.on_sliding_faces(prepared.model.mesh.nodes));
    LocatedMatches kept;
    for (std::size_t n = 0; n < located.matches.size(); ++n) {
        if (sliding.any_within(located.matches[n].moving, sliding_match_options.beside_mm)) continue;
        kept.matches.push_back(located.matches[n]);
        kept.places.push_back(located.places[n]);
    }
    located = std::move(kept);
}

}  // namespace

std::vector<Doubt> doubts_of(const ImageFit& fit, const std::string& name, const ImageDoubtLimits& limits) {
    std::vector<Doubt> doubts;
    if (fit.matched < limits.least_matched * fit.blocks)
        doubts.push_back({"image.blocks_lost", fit.matched / double(fit.blocks), limits.least_matched,
                          "only " + std::to_string(fit.matched) + " of " + std::to_string(fit.blocks) +
                              " blocks of the moving " + name + " that lie in view were found in the fixed one",
                          "check that both show the same organ, within the search range of each other"});
    if (fit.shown_share < limits.least_shown)
        doubts.push_back({"image.out_of_view", fit.shown_share, limits.least_shown,
                          "the fixed " + name + " shows only " + percent(fit.shown_share) +
                              " of the organ; the rest is where mechanics alone put it",
                          "trust the map uncertainty_trust, or show more of the organ", Severity::Notice});
    if (fit.agreement && *fit.agreement < limits.least_agreement)
        doubts.push_back({"image.disagree", *fit.agreement, limits.least_agreement,
                          "the moving and the fixed " + name + " agree too little where the organ lies (" +
                              to_text(*fit.agreement) + "; 0 is chance, 1 the same image)",
                          "check that they show the same organ, and look where the result lies"});
    if (fit.residual_mm > limits.most_residual_mm)
        doubts.push_back({"image.apart", fit.residual_mm, limits.most_residual_mm,
                          "blocks found in the fixed " + name + " lie " + to_text(fit.residual_mm) +
                              " mm from where the tissue went",
                          "look where image and result differ; give labels or landmarks beside the image"});
    return doubts;
}

std::vector<Doubt> doubts_of(const LeftBehind& left, double spacing_mm, const std::string& name,
                             const LeftBehindLimits& limits) {
    const double most_mm = std::max(limits.least_mm, limits.most_spacings * spacing_mm);
    if (left.distance_mm <= most_mm) return {};
    const auto at = [&](int axis) { return std::to_string(std::lround(left.place[axis])); };
    return {
        Doubt{"image.left_behind", left.distance_mm, most_mm,
              "regions of the moving " + name + " were found " + to_text(left.distance_mm) +
                  " mm from where the tissue went and farther, farthest about (" + at(0) + ", " + at(1) + ", " + at(2) +
                  ") mm",
              "look there where image and result differ; say which --tissue it is, or give labels of the fixed image"}};
}

std::vector<Doubt> doubts_of_echoes(double agreement, const std::optional<EchoPose>& pose, const std::string& name) {
    constexpr EchoDoubtLimits limits = echo_doubt_limits;
    std::vector<Doubt> doubts;
    if (agreement < limits.least_agreement)
        doubts.push_back({"image.echoes_unexplained", agreement, limits.least_agreement,
                          "the moving " + name + " explains little of the echoes where the organ lies (" +
                              to_text(agreement) + " of what chance leaves)",
                          "check that they show the same organ, and look where the result lies"});
    if (!pose) return doubts;
    const auto& [motion, support, rival_mm, rival_support] = *pose;
    if (support < limits.least_support)
        doubts.push_back({"image.pose_unclear", support, limits.least_support,
                          "the ultrasound hardly tells where the organ lies as a whole",
                          "bring the images nearer with --initial-transform, or give pairs of points"});
    if (rival_mm > 0 && rival_support > limits.most_rival * support)
        doubts.push_back(
            {"image.two_poses", rival_support / support, limits.most_rival,
             "the ultrasound fits nearly as well " + to_text(rival_mm) + " mm from where the organ was put",
             "bring the images nearer with --initial-transform, or give pairs of points"});
    return doubts;
}

ImageTerm::ImageTerm(const PreparedModel& prepared, const ImageModel& moving, const imaging::Volume& fixed,
                     std::string name, const ImageOptions& options, ImageTools& tools, double energy)
    : prepared_(prepared),
      name_(std::move(name)),
      options_(options),
      energy_(energy),
      search_(prepared.model.mesh, moving, fixed, options, tools),
      cubes_(*tools.cubes),
      view_(search_.seen()) {}

void ImageTerm::tell_similarity(Observer& observer) const {
    if (search_.similarity() != Similarity::LinearCombination) return;
    observer.note("the fixed " + name_ +
                  " is taken for ultrasound: what the moving one shows is fitted to its echoes "
                  "(--similarity states how images are compared)");
}

void ImageTerm::search(const State& state, Observer& observer) {
    if (search_.done() == 0 && !echo_pose_) tell_similarity(observer);
    LocatedMatches located = search_.search(state, observer);
    if (!prepared_.sliding.empty()) leave_out_beside_sliding(prepared_, located);
    found_.matches = std::move(located.matches);
    found_.places = std::move(located.places);
    found_.strongest.resize(found_.matches.size());
    tbb::parallel_for(std::size_t{0}, found_.strongest.size(), [&](std::size_t n) {
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
        axes.computeDirect(found_.matches[n].information, Eigen::EigenvaluesOnly);
        found_.strongest[n] = axes.eigenvalues()[2];
    });
    found_.shares = NodalShares(prepared_.model.mesh, found_.places);
}

Alignment ImageTerm::pose(const Eigen::Isometry3d& /*start*/, Observer& observer) {
    const State by_headers{Eigen::Isometry3d::Identity(), Eigen::Matrix3Xd::Zero(3, prepared_.rest.node_count)};
    echo_pose_ = search_.echo_pose(by_headers, observer);
    if (echo_pose_) {
        tell_similarity(observer);
        has_placed_ = true;
        return {echo_pose_->motion, 0};
    }
    search(by_headers, observer);
    search_turned(by_headers, observer);
    const std::optional<Eigen::Isometry3d> motion = rigid_motion();
    has_placed_ = motion.has_value();
    return {motion.value_or(Eigen::Isometry3d::Identity()), 0};
}

void ImageTerm::search_turned(const State& by_headers, Observer& observer) {
    const int in_view = blocks_in_view(by_headers);
    const double least = image_pose_options.found_share * in_view;
    if (double(search_.blocks_found()) >= least) return;
    const std::vector<FoundPose> poses =
        turned_poses(search_.moving().image, prepared_.model.mesh.nodes, search_.image(), search_.seen(), observer);
    for (const FoundPose& pose : poses) {
        const State turned{pose.placement, by_headers.displacement};
        if (double(search_.block_search(turned, observer).matches.size()) < least) continue;
        search_.begin_anew();
        search(turned, observer);
        const double angle = Eigen::AngleAxisd(pose.placement.linear()).angle() * 180 / EIGEN_PI;
        observer.note("the fixed " + name_ + " lies otherwise than the headers say, turned by " +
                      std::to_string(std::lround(angle)) + " degrees: there its blocks were found");
        return;
    }
}

std::optional<Eigen::Isometry3d> ImageTerm::rigid_motion() const {
    if (found_.matches.size() < image_pose_options.fewest_blocks)
        throw InvalidInput("only " + std::to_string(found_.matches.size()) +
                           " blocks of the moving image were found in the fixed one; check that they show the same "
                           "organ, and bring them within the search range of each other");
    const auto count = static_cast<Eigen::Index>(found_.matches.size());
    Eigen::Matrix3Xd moving(3, count), fixed(3, count);
    for (Eigen::Index n = 0; n < count; ++n) {
        moving.col(n) = found_.matches[static_cast<std::size_t>(n)].moving;
        fixed.col(n) = found_.matches[static_cast<std::size_t>(n)].fixed;
    }
    const Eigen::Isometry3d motion = least_trimmed_motion(moving, fixed);
    if (share_in_view(prepared_, view_) >= image_pose_options.whole_view) return motion;
    const double without = median_distance(moving, fixed), with = median_distance(motion * moving, fixed);
    const bool deforms = with > image_pose_options.most_left * without && without < options_.headers_within_mm;
    return deforms ? std::nullopt : std::optional(motion);
}

bool ImageTerm::take_over(const UpdateResult& last) {
    has_placed_ = last.pulls.prior_moves == PriorMoves::WithData;
    return !shows_echoes();
}

const std::vector<ImageTerm::PulledMatch>& ImageTerm::pulled(const State& state) {
    const Eigen::Isometry3d back = state.placement.inverse();
    memory_.pulled.resize(found_.matches.size());
    tbb::parallel_for(std::size_t{0}, memory_.pulled.size(), [&](std::size_t n) {
        const BlockMatch& match = found_.matches[n];
        const meshing::Location& place = found_.places[n];
        const Eigen::Matrix3d information = back.linear() * match.information * back.linear().transpose();
        const Eigen::Vector3d target = back * match.fixed - match.moving,
                              e = target - displacement_at(prepared_.model.mesh, state.displacement, place),
                              force = information * e;
        memory_.pulled[n] = {{information, force}, match.confidence, std::sqrt(e.dot(force) / found_.strongest[n])};
    });
    return memory_.pulled;
}

double ImageTerm::mean_residual(const std::vector<PulledMatch>& matches) {
    double sum = 0, weights = 0;
    for (const PulledMatch& match : matches) {
        sum += match.confidence * match.residual_mm;
        weights += match.confidence;
    }
    return weights > 0 ? sum / weights : 0;
}

Contribution ImageTerm::linearise(const RoundPlan& plan, const State& state, Observer& observer) {
    Contribution result;
    if (search_.done() < plan.searches_due) {
        search(state, observer);
        result.pulls_anew = true;
    }
    const std::vector<PulledMatch>& matches = pulled(state);
    const double most_mm = most_image_steps * plan.most_step_mm;
    memory_.forces.resize(matches.size());
    tbb::parallel_for(std::size_t{0}, matches.size(), [&](std::size_t n) {
        const double weight = energy_ * matches[n].confidence * robust_weight(matches[n].residual_mm, plan.scale_mm);
        const double step = most_mm / std::max(most_mm, matches[n].residual_mm);
        memory_.forces[n] = {weight * matches[n].pull.stiffness, step * weight * matches[n].pull.force};
    });
    result.held_back = static_cast<int>(std::count_if(
        matches.begin(), matches.end(), [&](const PulledMatch& match) { return match.residual_mm > most_mm; }));
    result.candidates =
        std::max(static_cast<int>(search_.moving().blocks.points().cols()), static_cast<int>(matches.size()));
    result.matched = static_cast<int>(matches.size());
    result.mean_residual_mm = mean_residual(matches);
    const bool echoes = search_.similarity() == Similarity::LinearCombination;
    const double agreement = search_.agreement().value_or(shared_errors.full_agreement);
    const DatumKind kind = echoes ? ultrasound_kind(agreement)
                                  : image_kind(search_.moving().image.geometry, search_.image().geometry, agreement);
    result.springs = pulled_by(kind, lumped_springs(found_.shares, memory_.forces, state.displacement));
    leave_out_of_view(state, result.springs);
    return result;
}

void ImageTerm::leave_out_of_view(const State& state, std::vector<PulledNode>& springs) const {
    const auto count = static_cast<Eigen::Index>(springs.size());
    Eigen::Matrix3Xd places(3, count);
    for (Eigen::Index n = 0; n < count; ++n) {
        const int node = springs[static_cast<std::size_t>(n)].spring.node;
        places.col(n) = state.placement * (prepared_.model.mesh.nodes.col(node) + state.displacement.col(node));
    }
    const std::vector<char> in_view = view_.holds(places);
    for (std::size_t n = 0; n < springs.size(); ++n)
        if (!in_view[n]) springs[n].shows_mm = -1;
}

int ImageTerm::blocks_in_view(const State& state) const {
    const std::vector<char> in_view = view_.holds(search_.deformed(search_.moving().blocks.points(), state));
    const auto count = std::count(in_view.begin(), in_view.end(), char{1});
    return std::max(static_cast<int>(count), static_cast<int>(search_.blocks_found()));
}

ImageFit ImageTerm::fit(const State& state) {
    const Eigen::Matrix3Xd& nodes = prepared_.model.mesh.nodes;
    const bool echoes = search_.similarity() == Similarity::LinearCombination;
    ImageFit fit;
    fit.blocks = echoes ? search_.places_sought() : blocks_in_view(state);
    fit.matched = static_cast<int>(search_.blocks_found());
    std::vector<Eigen::Vector3d> places;
    places.reserve(found_.matches.size());
    for (const BlockMatch& match : found_.matches) places.push_back(match.moving);
    const meshing::PointTree matched(places);
    const auto shown = tbb::parallel_reduce(
        tbb::blocked_range<Eigen::Index>(0, nodes.cols()), Eigen::Index{0},
        [&](const tbb::blocked_range<Eigen::Index>& range, Eigen::Index count) {
            for (Eigen::Index node = range.begin(); node < range.end(); ++node)
                count += matched.any_within(nodes.col(node), image_doubt_limits.shown_within_mm);
            return count;
        },
        std::plus<>());
    fit.shown_share = double(shown) / double(nodes.cols());
    fit.residual_mm = mean_residual(pulled(state));
    if (!echoes) fit.agreement = search_.agreement();
    return fit;
}

LeftBehind ImageTerm::left_behind_of(const LocatedMatches& blocks, const State& state) const {
    std::vector<Eigen::Vector3d> surface;
    for (const InterfaceNode& node : prepared_.interfaces.nodes())
        if (node.outer == 0) surface.push_back(prepared_.model.mesh.nodes.col(node.node));
    const meshing::PointTree outside(surface);
    std::vector<char> is_deep(blocks.matches.size());
    tbb::parallel_for(std::size_t{0}, is_deep.size(), [&](std::size_t n) {
        is_deep[n] = !outside.any_within(blocks.matches[n].moving, left_behind_limits.depth_mm);
    });
    std::vector<BlockMatch> deep;
    std::vector<Eigen::Vector3d> went;
    for (std::size_t n = 0; n < blocks.matches.size(); ++n) {
        if (!is_deep[n]) continue;
        const Eigen::Vector3d& at = blocks.matches[n].moving;
        deep.push_back(blocks.matches[n]);
        went.push_back(state.placement *
                       (at + displacement_at(prepared_.model.mesh, state.displacement, blocks.places[n])));
    }
    return left_behind(deep, went, left_behind_limits.neighbours, left_behind_limits.percent);
}

std::vector<Doubt> ImageTerm::doubts_of_blocks(const State& state) const {
    if (shows_echoes()) return {};
    const auto doubts = [&](const LocatedMatches& blocks) {
        return doubts_of(left_behind_of(blocks, state),
                         larger_voxel(search_.moving().image.geometry, search_.image().geometry), name_);
    };
    if (doubts(search_.blocks()).empty()) return {};
    return doubts(search_.block_search(state, silent_observer()));  // the first may have erred, far from where they are
}

std::optional<Doubt> ImageTerm::doubt_of_tissue_gone(const State& state) const {
    if (shows_echoes()) return std::nullopt;
    const Deformation here{prepared_.model.mesh, state.displacement, state.placement};
    return doubt_of_image(tissue_gone(cubes_, here, search_.moving().image, search_.image(), view_), name_);
}

void ImageTerm::judge(const State& state, UpdateResult& result) {
    ImageFit fitted;
    std::vector<Doubt> of_blocks;
    std::optional<Doubt> of_tissue_gone;
    tbb::parallel_invoke([&] { fitted = fit(state); }, [&] { of_blocks = doubts_of_blocks(state); },
                         [&] { of_tissue_gone = doubt_of_tissue_gone(state); });
    result.images.push_back(fitted);
    ImageDoubtLimits limits = image_doubt_limits;
    if (shows_echoes()) limits.most_residual_mm = echo_doubt_limits.most_residual_mm;
    const auto add = [&](std::vector<Doubt> doubts) {
        std::move(doubts.begin(), doubts.end(), std::back_inserter(result.doubts));
    };
    add(doubts_of(fitted, name_, limits));
    add(std::move(of_blocks));
    if (of_tissue_gone) add({*of_tissue_gone});
    if (shows_echoes()) add(doubts_of_echoes(search_.agreement().value_or(0), echo_pose_, name_));
}

}  // namespace tissuewarp::registration::detail
