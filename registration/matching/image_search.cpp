#include "registration/matching/image_search.hpp"

#include "registration/matching/points/field_of_view.hpp"
#include "registration/matching/ultrasound/speckle.hpp"
#include "registration/springs/pull.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace tissuewarp::registration::detail {

ImageSearch::ImageSearch(const meshing::TetMesh& mesh, const ImageModel& moving, const imaging::Volume& fixed,
                         const ImageOptions& options, ImageTools& tools)
    : mesh_(mesh),
      moving_(moving),
      options_(options),
      locator_(*tools.locator),
      fixed_(fixed, tools.memory, [&](const imaging::Volume& image) { tools.engine->begin_fixed(image); }),
      engine_(*tools.engine),
      dense_(mesh, moving, engine_) {
    engine_.finish_fixed(fixed_);
    const bool stated = options.similarity == Similarity::LinearCombination;
    if (stated || (options.similarity == Similarity::Auto && shows_echoes()))
        ultrasound_.emplace(mesh, moving.image, fixed_, engine_.echoes());
}

bool ImageSearch::shows_echoes() const {
    constexpr double most_found = 1.0 / 3;  // of the blocks that are expected to be seen (docs/decisions/ultrasound.md)
    if (!is_speckled(fixed_)) return false;
    const State by_headers{Eigen::Isometry3d::Identity(), Eigen::Matrix3Xd::Zero(3, mesh_.nodes.cols())};
    const Eigen::Matrix3Xd& points = moving_.blocks.points();
    const std::vector<char> in_view = FieldOfView(fixed_.seen).holds(points);
    const auto expected = std::count(in_view.begin(), in_view.end(), char{1});
    if (expected == 0) return false;
    const auto found = block_search(by_headers, silent_observer()).matches.size();
    return double(found) < most_found * double(expected) && has_more_speckle(fixed_, SeenImage(moving_.image));
}

std::optional<EchoPose> ImageSearch::echo_pose(const State& state, Observer& observer) {
    return ultrasound_ ? std::optional(ultrasound_->pose(state, observer)) : std::nullopt;
}

LocatedMatches ImageSearch::search(const State& state, Observer& observer) {
    LocatedMatches found = ultrasound_  ? echo_search(state)
                           : done_ == 0 ? block_search(state, observer)
                                        : dense_search(state);
    if (done_ == 0 && !ultrasound_) blocks_ = found;
    ++done_;
    return found;
}

LocatedMatches ImageSearch::block_search(const State& state, Observer& observer) const {
    const MatchingTemplate& blocks = moving_.blocks;
    BlockMatchingOptions matching = options_.matching;
    matching.rotation = state.placement.linear();
    matching.finest = FinestGrid::UndescribedPoints;
    return located(consistent_matches(search_blocks(blocks, fixed_.image.geometry, engine_.blocks(),
                                                    deformed(blocks.points(), state), matching, observer),
                                      options_.consistency));
}

LocatedMatches ImageSearch::dense_search(const State& state) {
    const std::vector<int>& grids = options_.dense_coarsening;
    const int coarsening = grids.at(std::min(static_cast<std::size_t>(done_), grids.size()) - 1);
    DenseMatches dense = dense_.matches(state, coarsening, blocks_, locator_);
    if (coarsening == last_coarsening_) gain_ = dense.agreement - *agreement_;
    last_coarsening_ = coarsening;
    agreement_ = dense.agreement;
    return std::move(dense.found);
}

LocatedMatches ImageSearch::echo_search(const State& state) {
    DenseMatches echoes = ultrasound_->matches(state, done_, locator_);
    agreement_ = echoes.agreement;
    blocks_ = echoes.found;
    return std::move(echoes.found);
}

Eigen::Matrix3Xd ImageSearch::deformed(const Eigen::Matrix3Xd& points, const State& state) const {
    if (state.displacement.isZero(0)) return state.placement * points;
    Eigen::Matrix3Xd result = points;
    tbb::parallel_for(Eigen::Index{0}, points.cols(), [&](Eigen::Index n) {
        if (const auto at = locate_near(locator_, points.col(n)))
            result.col(n) += displacement_at(mesh_, state.displacement, *at);
    });
    return state.placement * result;
}

LocatedMatches ImageSearch::located(const std::vector<BlockMatch>& matches) const {
    std::vector<std::optional<meshing::Location>> places(matches.size());
    tbb::parallel_for(std::size_t{0}, matches.size(),
                      [&](std::size_t n) { places[n] = locate_near(locator_, matches[n].moving); });
    LocatedMatches result;
    result.reserve(matches.size());
    for (std::size_t n = 0; n < matches.size(); ++n)
        if (places[n]) result.add(matches[n], *places[n]);
    return result;
}

}  // namespace tissuewarp::registration::detail
