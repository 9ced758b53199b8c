#pragma once
/// All data of one registration together, and what holds tissue that they do not show.

#include "registration/terms/contact.hpp"
#include "registration/terms/curves.hpp"
#include "registration/terms/image.hpp"
#include "registration/terms/labels.hpp"
#include "registration/terms/points.hpp"
#include "registration/terms/surface.hpp"

namespace tissuewarp::registration::detail {

/// Throws InvalidInput when there is nothing to register to, an image but no model of one, or no label in common.
void require_usable(const PreparedModel& prepared, const Intraoperative& seen);

/// The data that are there. The model, what was seen and the options outlive it.
struct EvidenceSet {
    std::optional<LabelEvidence> labels;  ///< once the images are aligned
    std::optional<ImageEvidence> image;
    std::optional<SurfaceEvidence> surface;
    std::optional<PointEvidence> points;
    std::optional<CurveEvidence> curves;
    std::optional<ContactEvidence> contact;
    double energy = 0;                 ///< mN mm that weighs as much as one standard deviation of a point
    std::vector<tled::Spring> ground;  ///< moves with the placement
    std::vector<tled::Spring> anchors;
    bool placed = false;  ///< anchors or rigid neighbours say where the organ lies as a whole

    /// `image_tools` are there where the model has an image. Throws InvalidInput for data that cannot be used.
    EvidenceSet(const PreparedModel& prepared, const Intraoperative& seen, const UpdateOptions& options,
                std::optional<ImageTools>& image_tools);

    /// Labels say where every boundary is, and an image holds what it does not show.
    [[nodiscard]] bool only_points() const { return !labels && !image; }

    /// Springs of all data together.
    [[nodiscard]] Contribution contribution(const RoundPlan& plan, const State& state);

    /// What holds tissue and is no datum: anchors, and rigid neighbours where tissue touches them.
    [[nodiscard]] std::vector<tled::Spring> supports(const RoundPlan& plan, const State& state) const;

    /// Writes to the result how each of them agrees with the model.
    void judge(const State& state, UpdateResult& result);
};

/// Where the model starts: by labels; or by pairs of points that show how it is turned; or by points of its surface; or
/// by curves, from where the headers place the images or what pairs there are shift them; or by these pairs alone; or
/// by the matches of a first search, from where the headers place the images.
Alignment align(const PreparedModel& prepared, const Intraoperative& seen, EvidenceSet& evidence,
                const UpdateOptions& options, Observer& observer);

}  // namespace tissuewarp::registration::detail
