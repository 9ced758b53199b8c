#pragma once
/// A bare intraoperative volume: blocks of the preoperative image belong where they were found.

#include "registration/detail/evidence.hpp"
#include "registration/detail/pull.hpp"

namespace tissuewarp::registration::detail {

class ImageEvidence {
public:
    /// `prepared.image` is there.
    ImageEvidence(const PreparedModel& prepared, const imaging::Volume& fixed, const ImageOptions& options);

    /// Finds the blocks about where the model is.
    void search(const State& state, Observer& observer);
    /// The rigid motion that the matches found agree on: what is left of them is for the tissue.
    [[nodiscard]] Eigen::Isometry3d rigid_motion() const;
    /// Pulls of the matches on the nodes.
    [[nodiscard]] Contribution contribution(const RoundPlan& plan, const State& state) const;

    [[nodiscard]] int searches_done() const { return searches_; }

private:
    const PreparedModel& prepared_;
    const imaging::Volume& fixed_;
    const ImageOptions& options_;
    meshing::PointLocator locator_;
    double energy_;  // mN mm that one standard deviation of a match weighs
    int searches_ = 0;
    std::vector<BlockMatch> matches_;
    std::vector<meshing::Location> places_;  // of the matches, in the mesh

    void keep_those_in_tissue(std::vector<BlockMatch> matches);
};

}  // namespace tissuewarp::registration::detail
