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
    /// `prepared.image` is there. The engine finds blocks, and forces after the first search. `energy` (mN mm) weighs
    /// as much as one standard deviation of a match.
    ImageEvidence(const PreparedModel& prepared, const imaging::Volume& fixed, const ImageOptions& options,
                  ImageTools& tools, double energy);

    /// Finds the blocks about where the model is; the later times, how all of the image is to shift there. After the
    /// last of searches() the last grid is searched again.
    void search(const State& state, Observer& observer);
    /// The rigid motion that most matches agree on, the rest of them is for the tissue. Where part of the organ is out
    /// of view, a deformation of the part in view would turn it as a whole: then none, unless the headers are far off.
    /// Throws InvalidInput when too few blocks were found.
    [[nodiscard]] Eigen::Isometry3d rigid_motion() const;
    /// Pulls of the matches on the nodes.
    [[nodiscard]] Contribution contribution(const RoundPlan& plan, const State& state);

    /// How the matches agree with a model in this state.
    [[nodiscard]] ImageFit fit(const State& state);
    [[nodiscard]] int searches_done() const { return searches_done_; }
    /// How many there are to be.
    [[nodiscard]] int searches() const;
    /// Whether another dense search on the last grid may bring the images nearer: the last search on a grid that had
    /// been searched before found them to agree better by a hundredth or more.
    [[nodiscard]] bool gains() const { return gain_ >= 0.01; }

private:
    const PreparedModel& prepared_;
    SeenImage fixed_;
    const ImageOptions& options_;
    FieldOfView view_;  // of `fixed_`
    const meshing::PointLocator& locator_;
    double energy_;  // mN mm that one standard deviation of a match weighs
    ImageEngine& engine_;
    DenseSearch dense_;
    int searches_done_ = 0;
    LocatedMatches blocks_, matches_;  // of the first search, and of the last
    std::vector<double> strongest_;    // of each of `matches_`: the largest eigenvalue of its information
    NodalShares shares_;               // of the nodes in `matches_`
    std::optional<double> agreement_;  // of both images, in the last dense search
    int last_coarsening_ = -1;         // of its grid
    double gain_ = 0;                  // in agreement, see gains()
    std::vector<tled::Spring> ground_;
    Eigen::Isometry3d ground_at_ = Eigen::Isometry3d::Identity();

    /// Whether the fixed image could show tissue at a point of its frame.
    [[nodiscard]] bool in_view(const Eigen::Vector3d& point) const;
    /// Which nodes of the organ's outer surface could be shown with the organ placed so; 0 for all other nodes.
    [[nodiscard]] std::vector<char> surface_in_view(const Eigen::Isometry3d& placement) const;
    /// Of the organ's outer surface, where the headers place it.
    [[nodiscard]] double view_share() const;
    struct PulledMatch {
        PullForce pull;  // its stiffness is the match's information
        double confidence;
        double residual_mm;  // along what the block shows best
    };
    /// Those that lie in the model.
    [[nodiscard]] LocatedMatches located(const std::vector<BlockMatch>& matches) const;
    void use(LocatedMatches matches);
    /// Of all matches, in `pulled_`.
    const std::vector<PulledMatch>& pulled(const State& state);
    /// Springs of the outer surface, by what is expected of it in view and out of it.
    [[nodiscard]] const std::vector<tled::Spring>& ground(const Eigen::Isometry3d& placement);
    // kept from round to round: fresh memory costs more than what is computed in it
    std::vector<PulledMatch> pulled_;
    std::vector<PullForce> forces_;

    static double mean_residual(const std::vector<PulledMatch>& matches);
    [[nodiscard]] std::vector<BlockMatch> block_search(const State& state, Observer& observer) const;
    /// Where points of the moving image are in the fixed one.
    [[nodiscard]] Eigen::Matrix3Xd deformed(const Eigen::Matrix3Xd& points, const State& state) const;
};

}  // namespace tissuewarp::registration::detail
