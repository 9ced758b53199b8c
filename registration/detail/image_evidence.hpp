#pragma once
/// A bare intraoperative volume: blocks of the preoperative image, then all of it, belong where they were found.

#include "registration/detail/block_search.hpp"
#include "registration/detail/dense_search.hpp"
#include "registration/detail/evidence.hpp"
#include "registration/detail/field_of_view.hpp"
#include "registration/detail/pull.hpp"

namespace tissuewarp::registration::detail {

class ImageEvidence {
public:
    /// `prepared.image` is there. `engine` finds blocks, and forces after the first search; without it
    /// the processor finds blocks, and that is all. `energy` (mN mm)
    /// weighs as much as one standard deviation of a match.
    ImageEvidence(const PreparedModel& prepared, const imaging::Volume& fixed, const ImageOptions& options,
                  ImageEngine* engine, double energy);

    /// Finds the blocks about where the model is; the later times, how all of the image is to shift there.
    void search(const State& state, Observer& observer);
    /// Takes matches that were found before.
    void use(std::vector<BlockMatch> matches);
    /// The rigid motion that most matches agree on, the rest of them is for the tissue. Where part of the organ is out
    /// of view, a deformation of the part in view would turn it as a whole: then none, unless the headers are far off.
    /// Throws InvalidInput when too few blocks were found.
    [[nodiscard]] Eigen::Isometry3d rigid_motion() const;
    /// Pulls of the matches on the nodes.
    [[nodiscard]] Contribution contribution(const RoundPlan& plan, const State& state) const;

    /// How the matches agree with a model in this state.
    [[nodiscard]] ImageFit fit(const State& state) const;
    [[nodiscard]] int searches_done() const { return searches_done_; }
    /// How many there are to be.
    [[nodiscard]] int searches() const;

private:
    const PreparedModel& prepared_;
    SeenImage fixed_;
    const ImageOptions& options_;
    FieldOfView view_;  // of `fixed_`
    meshing::PointLocator locator_;
    double energy_;                            // mN mm that one standard deviation of a match weighs
    std::unique_ptr<BlockEngine> own_blocks_;  // where no engine was given
    BlockEngine* block_engine_ = nullptr;
    std::optional<DenseSearch> dense_;
    int searches_done_ = 0;
    struct Located {
        std::vector<BlockMatch> matches;
        std::vector<meshing::Location> places;  // in the mesh
    };
    Located blocks_, matches_;         // of the first search, and of the last
    std::optional<double> agreement_;  // of both images, in the last dense search

    /// Whether the fixed image could show tissue at a point of its frame.
    [[nodiscard]] bool in_view(const Eigen::Vector3d& point) const;
    /// Of the organ's outer surface, where the headers place it.
    [[nodiscard]] double view_share() const;
    struct PulledMatch {
        Pull pull;  // its stiffness is the match's information
        double confidence;
        double residual_mm;  // along what the block shows best
    };
    /// Those that lie in the model.
    [[nodiscard]] Located located(std::vector<BlockMatch> matches) const;
    [[nodiscard]] std::vector<PulledMatch> pulled(const Located& located, const State& state) const;
    static double mean_residual(const std::vector<PulledMatch>& matches);
    [[nodiscard]] std::vector<BlockMatch> block_search(const State& state, Observer& observer) const;
    /// Where points of the moving image are in the fixed one.
    [[nodiscard]] Eigen::Matrix3Xd deformed(const Eigen::Matrix3Xd& points, const State& state) const;
};

}  // namespace tissuewarp::registration::detail
