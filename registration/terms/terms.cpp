#include "registration/terms/terms.hpp"

#include "imaging/labels.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/terms/anchors.hpp"
#include "registration/terms/cavity.hpp"
#include "registration/terms/contact.hpp"
#include "registration/terms/curves.hpp"
#include "registration/terms/ground.hpp"
#include "registration/terms/image.hpp"
#include "registration/terms/labels.hpp"
#include "registration/terms/loads.hpp"
#include "registration/terms/outline.hpp"
#include "registration/terms/points.hpp"
#include "registration/terms/surface.hpp"
#include "registration/terms/view_prior.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

void require_usable(const PreparedModel& prepared, const Intraoperative& seen, std::size_t tools) {
    if (!seen.labels && !seen.image && !seen.surface && !seen.points && !seen.curves)
        throw InvalidInput(
            "nothing to register to; give labels, an image, points of a surface, pairs of points or curves");
    if (!seen.image && !seen.contrasts.empty())
        throw InvalidInput("contrasts were given without the image that they belong to");
    if (!seen.image) return;
    if (!prepared.image)
        throw InvalidInput("a bare volume was given, but the model holds no preoperative image; call prepare_image");
    if (seen.contrasts.size() > prepared.contrasts.size())
        throw InvalidInput("the model holds " + std::to_string(prepared.contrasts.size()) + " contrasts, and " +
                           std::to_string(seen.contrasts.size()) + " were given; call prepare_contrast for each");
    if (tools < 1 + seen.contrasts.size())
        throw InvalidInput("the model got its image after its updater was made; make the updater after prepare_image");
}

/// One for the image and each of its contrasts, one for the wall of a cavity that no labels show and one for the outer
/// surface beside it where images show the organ alone, and what is expected of tissue by what the image has in view.
void add_images(std::vector<std::unique_ptr<Term>>& terms, const PreparedModel& prepared, const Intraoperative& seen,
                const UpdateOptions& all, std::vector<ImageTools>& tools, double energy) {
    const ImageOptions& options = all.image;
    auto image =
        std::make_unique<ImageTerm>(prepared, *prepared.image, *seen.image, "image", options, tools[0], energy);
    auto prior = std::make_unique<ViewPrior>(prepared, image->view(), options, energy);
    if (!prepared.resected.empty() && !seen.labels && !image->shows_echoes()) {
        terms.push_back(std::make_unique<CavityTerm>(prepared, *seen.image, image->view(), all));
        if (auto outline = outline_term(prepared, image->shown(), all)) terms.push_back(std::move(outline));
    }
    terms.push_back(std::move(image));
    for (std::size_t n = 0; n < seen.contrasts.size(); ++n)
        terms.push_back(std::make_unique<ImageTerm>(prepared, *prepared.contrasts[n], seen.contrasts[n],
                                                    "contrast " + std::to_string(n + 2), options, tools[n + 1],
                                                    energy));
    terms.push_back(std::move(prior));
}

/// What springs seem to feel of a turn about the line of pairs that tell a shift alone, since they pull at the nodes
/// around: a quarter of this. By hand: pairs on a line of 70 mm in an organ of 100 have 0.010 to 0.014.
constexpr double turn_felt_of_a_line = 0.06;

}  // namespace

Terms::Terms(std::vector<std::unique_ptr<Term>> terms, double energy, bool align)
    : terms_(std::move(terms)), energy_(energy) {
    const bool boundary = any_shows(Shows::Boundary), volume = any_shows(Shows::Volume),
               placed = any_shows(Shows::Place);
    parts_alone_ = !boundary && !volume;
    placement_sought_ = align && !placed;
    free_placement_ = parts_alone_ && placement_sought_;
    take_own_metric_ = volume || !boundary || placed;
    if (free_placement_) unknown_loads_ = LoadKind::Bends;
    if (boundary && !volume && !placed) unknown_loads_ = LoadKind::Weight;
}

bool Terms::any_shows(Shows what) const {
    return std::any_of(terms_.begin(), terms_.end(), [&](const auto& term) { return term->shows() == what; });
}

Term& Terms::best_placed() const {
    const auto less = [](const auto& a, const auto& b) { return a->pose_claim() < b->pose_claim(); };
    return **std::max_element(terms_.begin(), terms_.end(), less);
}

bool Terms::shift_alone() const {
    return placement_sought_ && best_placed().pose_claim() == PoseClaim::Shift;
}

PriorMoves Terms::prior_moves() const {
    if (free_placement_) return PriorMoves::WithSurface;
    const bool placed = std::any_of(terms_.begin(), terms_.end(), [](const auto& term) { return term->has_placed(); });
    return placed ? PriorMoves::WithData : PriorMoves::Not;
}

HardlyShown Terms::hardly_shown(const Eigen::Isometry3d& placement, const Eigen::Matrix3Xd& nodes) const {
    if (!placement_sought_) return {};
    if (shift_alone()) return {TissuePrior().free_motion_mm, turn_felt_of_a_line};
    const Eigen::Matrix3Xd arms = nodes.colwise() - nodes.rowwise().mean();
    const double turned_mm = std::sqrt((placement.linear() * arms - arms).colwise().squaredNorm().mean());
    const HardlyTold told = best_placed().hardly_told();
    return {told.of_turn * turned_mm, told.below_share};
}

Alignment Terms::pose(Observer& observer) {
    Term& best = best_placed();
    Eigen::Isometry3d start = Eigen::Isometry3d::Identity();
    for (const auto& term : terms_)
        if (term->pose_claim() == PoseClaim::Shift) start = term->pose(start, observer).placement;
    return best.pose(start, observer);
}

bool Terms::take_over(const UpdateResult& last) {
    return std::all_of(terms_.begin(), terms_.end(), [&](const auto& term) { return term->take_over(last); });
}

int Terms::searches() const {
    int most = 0;
    for (const auto& term : terms_) most = std::max(most, term->searches());
    return most;
}

bool Terms::gains() const {
    return std::any_of(terms_.begin(), terms_.end(), [](const auto& term) { return term->gains(); });
}

Contribution Terms::linearise(const RoundPlan& plan, const State& state, Observer& observer) {
    Contribution sum;
    for (const auto& term : terms_) add(sum, term->linearise(plan, state, observer));
    std::stable_sort(sum.springs.begin(), sum.springs.end(),
                     [](const PulledNode& a, const PulledNode& b) { return a.origin < b.origin; });
    return sum;
}

bool Terms::follow(const State& solved) {
    bool again = false;
    for (const auto& term : terms_) again |= term->follow(solved);
    return again;
}

bool Terms::settled(const State& state) const {
    return std::all_of(terms_.begin(), terms_.end(), [&](const auto& term) { return term->settled(state); });
}

void Terms::judge(const State& state, UpdateResult& result) {
    for (const auto& term : terms_) term->judge(state, result);
    if (shift_alone())
        result.doubts.push_back({"placement.turn_unknown", 0, 1,
                                 "the data tell how far the organ was shifted, not how it is turned",
                                 "give three pairs of points or more that are not on a line, or more of the organ"});
}

Terms terms_of(const PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& options,
               SharedTools& tools, std::vector<SeenBody> bodies) {
    require_usable(prepared, seen, tools.images.size());
    const double energy = strain_energy_unit(prepared, options.tissue);
    std::vector<std::unique_ptr<Term>> terms;
    if (seen.labels) {
        if (!tools.labels) tools.labels = std::make_shared<LabelTools>(prepared);
        terms.push_back(std::make_unique<LabelTerm>(prepared, tools.labels, *seen.labels, options));
    }
    if (seen.image) add_images(terms, prepared, seen, options, tools.images, energy);
    if (seen.surface) {
        if (!tools.organ) tools.organ = std::make_shared<const OrganSurface>(prepared);
        terms.push_back(std::make_unique<SurfaceTerm>(prepared, tools.organ, *seen.surface, options.surface,
                                                      options.alignment, energy));
    }
    if (seen.points) terms.push_back(std::make_unique<PointTerm>(prepared, *seen.points, options.points, energy));
    if (seen.curves) terms.push_back(std::make_unique<CurveTerm>(prepared, *seen.curves, options.curves, energy));
    if (!prepared.options.anchors.empty()) terms.push_back(std::make_unique<AnchorTerm>(prepared, energy));
    if (prepared.neighbours) terms.push_back(std::make_unique<ContactTerm>(prepared, energy, std::move(bodies)));
    if (!seen.labels && !seen.image)
        terms.push_back(std::make_unique<GroundTerm>(
            prepared, energy, options.align ? options.tissue.free_motion_mm : options.tissue.held_motion_mm));
    terms.push_back(std::make_unique<LoadTerm>(prepared, options.loads));
    return {std::move(terms), energy, options.align};
}

}  // namespace tissuewarp::registration::detail
