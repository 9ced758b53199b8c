#pragma once
/// The searches of a bare intraoperative volume: first for blocks of the preoperative image, then, with dense forces,
/// for how all of it is to shift.

#include "registration/matching/blocks/block_search.hpp"
#include "registration/matching/dense/dense_search.hpp"
#include "registration/matching/image_matching.hpp"
#include "registration/matching/ultrasound/ultrasound_search.hpp"
#include "registration/options.hpp"
#include "registration/prepare.hpp"

#include <optional>

namespace tissuewarp::registration::detail {

/// Whether an image is searched on. Chosen together with CourseOptions::more_searches and on the same images.
struct SearchGain {
    double least_agreement = 0.01;  ///< gained by a search on a grid that had been searched before
};
inline constexpr SearchGain search_gain{};

class ImageSearch {
public:
    /// Of a moving image of the tissue that is meshed. Mesh, image, options and tools outlive this.
    ImageSearch(const meshing::TetMesh& mesh, const ImageModel& moving, const imaging::Volume& fixed,
                const ImageOptions& options, ImageTools& tools);

    /// What a search about where the model is finds, at places of the mesh. After the last of count() the last grid is
    /// searched again.
    [[nodiscard]] LocatedMatches search(const State& state, Observer& observer);
    /// Of ultrasound, where the headers put the organ: how it lies as a whole. None of other images.
    [[nodiscard]] std::optional<EchoPose> echo_pose(const State& state, Observer& observer);
    /// How both images are compared; chosen when this was made.
    [[nodiscard]] Similarity similarity() const {
        return ultrasound_ ? Similarity::LinearCombination : Similarity::SelfSimilarity;
    }

    /// The next search is the first again.
    void begin_anew() { done_ = 0; }

    [[nodiscard]] int done() const { return done_; }
    /// How many there are to be.
    [[nodiscard]] int count() const {
        return ultrasound_ ? ultrasound_->count() : 1 + static_cast<int>(options_.dense_coarsening.size());
    }
    /// Whether another dense search on the last grid may bring the images nearer: the last search on a grid that had
    /// been searched before found them to agree better by SearchGain::least_agreement or more.
    [[nodiscard]] bool gains() const { return gain_ >= search_gain.least_agreement; }
    /// Of both images, in the last dense search: DenseForces::agreement.
    [[nodiscard]] std::optional<double> agreement() const { return agreement_; }
    /// Blocks of the preoperative image about where the model has put them.
    [[nodiscard]] LocatedMatches block_search(const State& state, Observer& observer) const;
    /// What the first search found, for blocks of the preoperative image; of ultrasound places, in the last.
    [[nodiscard]] const LocatedMatches& blocks() const { return blocks_; }
    /// Blocks that the first search found; of ultrasound places, in the last.
    [[nodiscard]] std::size_t blocks_found() const { return blocks_.matches.size(); }
    /// Places of ultrasound that the last search looked at.
    [[nodiscard]] int places_sought() const { return ultrasound_ ? ultrasound_->sought() : 0; }
    /// Where points of the moving image are in the fixed one.
    [[nodiscard]] Eigen::Matrix3Xd deformed(const Eigen::Matrix3Xd& points, const State& state) const;
    [[nodiscard]] const ImageModel& moving() const { return moving_; }
    /// The fixed image, float32.
    [[nodiscard]] const imaging::Volume& image() const { return fixed_.image; }
    /// Where the fixed image shows something.
    [[nodiscard]] const imaging::Volume& seen() const { return fixed_.seen; }

private:
    const meshing::TetMesh& mesh_;
    const ImageModel& moving_;
    const ImageOptions& options_;
    const meshing::PointLocator& locator_;
    SeenImage fixed_;
    ImageEngine& engine_;
    DenseSearch dense_;
    std::optional<UltrasoundSearch> ultrasound_;
    int done_ = 0;
    LocatedMatches blocks_;  // of the first search
    std::optional<double> agreement_;
    int last_coarsening_ = -1;  // of the grid of the last dense search
    double gain_ = 0;           // in agreement, see gains()

    [[nodiscard]] LocatedMatches dense_search(const State& state);
    [[nodiscard]] LocatedMatches echo_search(const State& state);
    /// Whether the fixed image is ultrasound: it shows speckle, and blocks of self-similarity are not found in it.
    [[nodiscard]] bool shows_echoes() const;
    /// Those that lie in the model.
    [[nodiscard]] LocatedMatches located(const std::vector<BlockMatch>& matches) const;
};

}  // namespace tissuewarp::registration::detail
