#pragma once
/// What an update found, and what it says of it.

#include "registration/deformation.hpp"
#include "registration/stage_time.hpp"
#include "tled/conditions.hpp"

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::registration {

namespace detail {
struct CarriedOn;
}

struct Alignment {
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed
    double mean_distance_mm = 0;  ///< mean truncated distance of the boundaries, with the fitted change of size
};

/// What a round of correspondence and equilibrium did.
struct Round {
    double range_mm = 0;
    int matched = 0, interface_nodes = 0;
    int held_back = 0;             ///< matches further away than the round's step bound
    double mean_residual_mm = 0;   ///< along the normal, after equilibrium, weighted
    double largest_change_mm = 0;  ///< of a node since the round before
    int force_evaluations = 0;
    double estimated_error_mm = 0;  ///< lifted residual at acceptance
};

/// How points of a surface agree with the registered model.
struct SurfaceFit {
    double inlier_share = 0;     ///< of the points: within the scale of the last round
    double residual_mm = 0;      ///< root mean square of those, along normals
    double coverage = 0;         ///< the area they stand for over that of the model's surface
    bool pose_searched = false;  ///< among all places, not only near the headers'
    double rival_mm = 0;         ///< from the chosen pose to the best other that headers leave open, mean over it
    double rival_support = 0;    ///< what that one explains of the points over what the chosen one explains
};

/// What was found of the preoperative image's blocks.
struct ImageFit {
    int blocks = 0, matched = 0;  ///< those that lie where the intraoperative image shows something, and those found
    double residual_mm = 0;       ///< of the last round, weighted by confidence
    double shown_share = 0;       ///< of the model's nodes: no further than 15 mm from a match
    /// Σ ∇D₁·∇D₂ over Σ ½ (|∇D₁|² + |∇D₂|²) of the images' descriptors, before the last rounds: 1 for the same image,
    /// near 0 for images of different things. Only with descriptors of self-similarity.
    std::optional<double> agreement;
};

/// How pairs of points agree with the registered model.
struct PointFit {
    int used = 0;            ///< pairs whose moving point lies in the model
    int outliers = 0;        ///< of those: beyond the scale of the last round
    double residual_mm = 0;  ///< root mean square of the others
};

/// How points along vessels agree with the registered model.
struct CurveFit {
    int points = 0;            ///< that were taken
    double inlier_share = 0;   ///< of them: within the scale of the last round of a line
    double residual_mm = 0;    ///< root mean square of those, across the line
    double length_mm = 0;      ///< of the preoperative lines in the model
    double rival_mm = 0;       ///< from the chosen pose to the best other that headers leave open, mean over these
    double rival_support = 0;  ///< what that one explains of the points over what the chosen one explains
};

/// How the organ lies to its rigid neighbours.
struct ContactFit {
    int touching = 0;       ///< surface nodes that a neighbour holds back
    double deepest_mm = 0;  ///< that a surface node lies in a neighbour, beyond where it lay at rest
};

/// A rigid neighbour that the fixed labels show.
struct BodyMotion {
    int label = 0;
    bool own = false;                                          ///< it did not move with the placement
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();  ///< moving → fixed
    double apart_mm = 0;                                       ///< of its boundaries after it, in the mean
};

/// How anchored tissue stayed where it was.
struct AnchorFit {
    int nodes = 0;
    double largest_mm = 0;  ///< displacement of one of them
};

/// What a spring stands for: equilibrium sums them all, the error estimate tells them apart.
enum class Origin {
    Datum,   ///< something that was seen
    Hold,    ///< where labels pull: to where a node was before the round, for the sake of the solver
    Prior,   ///< how far tissue is expected to have moved that no datum shows
    Support  ///< anchors, and contact with rigid neighbours
};

struct PulledNode {
    tled::Spring spring;
    Origin origin = Origin::Datum;
    /// Of a datum: the deviation along each axis of the error that it shares with data within a centimetre or so.
    double shared_mm = 0;
    /// Of a datum: tissue no further than this from the node is shown by it; negative: not even the node is.
    double shows_mm = 0;
};

/// What the springs of the prior move along with, so that they hold no motion of it as a whole.
enum class PriorMoves {
    Not,          ///< they stay where the headers or a search placed the organ
    WithSurface,  ///< the organ's surface, all over
    WithData      ///< tissue that data show
};

/// Motions of the organ as a whole that data of a kind tell worse than their springs feel them: boundaries of smooth
/// organs slide along themselves when the organ bends, and a turn of the whole hides there.
struct HardlyShown {
    double deviation_mm = 0;  ///< of a motion that springs do not feel, root mean square over the organ
    double below_share = 0;   ///< what springs feel of a motion (ShownMotions::shares) from which on nothing is added
};

/// What pulled at the tissue in the last round.
struct LastPulls {
    std::vector<PulledNode> springs;                              ///< in the order of their origins
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();  ///< moving → fixed, as it was in that round
    Eigen::Matrix3Xd loads;                                       ///< on the nodes, 3 × N, mN, those found among them
    double energy = 1;  ///< mN mm that weighs as much as one standard deviation of a datum
    PriorMoves prior_moves = PriorMoves::Not;
    bool parts_alone = false;       ///< points of it: neither labels nor an image show the organ as a whole
    bool placement_sought = false;  ///< by the data: neither headers nor what does not move place the organ
    HardlyShown hardly_shown = {};  ///< of the data that placed the organ
    double load_size = 0;           ///< of unknown loads that were found: they strain tissue by about its square times
                                    ///< `energy`; 0: none

    /// The springs of one origin.
    [[nodiscard]] std::vector<tled::Spring> of(Origin origin) const;
    /// Those of the data, with what else is known of them.
    [[nodiscard]] std::vector<PulledNode> data() const;
    /// Springs at the nodes whose rigid motion the prior moves along with, each as stiff as the node weighs; none where
    /// the prior does not move.
    [[nodiscard]] std::vector<tled::Spring> placed_by() const;
};

/// What a doubt says of the result.
enum class Severity {
    Notice,  ///< less is known, or it took longer, than was asked for: the result may be right all the same
    Doubt    ///< as results look that failed
};
/// "notice", "doubt".
const char* name_of(Severity severity);

/// A reason not to trust a result.
struct Doubt {
    std::string code;         ///< which one, for programs: `labels.unmatched`
    double value = 0;         ///< what was found …
    double limit = 0;         ///< … and what would have been in order
    std::string text = {};    ///< what is the matter, for people
    std::string remedy = {};  ///< what to do about it; empty where `text` says so
    Severity severity = Severity::Doubt;
};

/// What it says and what to do about it, for people.
std::string full_text(const Doubt& doubt);
std::vector<std::string> texts(const std::vector<Doubt>& doubts);
/// Those of severity Doubt.
int count_of_severe(const std::vector<Doubt>& doubts);

/// Where an update began (Updater::go_on).
struct Beginning {
    bool at_last = false;  ///< at the result of an earlier one, rather than with the rigid placement
    std::string why = {};  ///< why not, where one was given
};

struct UpdateResult {
    Deformation deformation;
    Alignment alignment;
    std::vector<Round> rounds;
    LastPulls pulls;
    std::string engine;  ///< description of the device that solved
    double min_jacobian = 1;
    std::vector<ImageFit> images;       ///< of the bare volume and its contrasts, where given
    std::optional<SurfaceFit> surface;  ///< where points of a surface were given
    std::optional<PointFit> points;     ///< where pairs of points were given
    std::optional<CurveFit> curves;     ///< where points along vessels were given
    std::optional<ContactFit> contact;  ///< where the model has rigid neighbours
    std::optional<AnchorFit> anchors;   ///< and anchors
    std::vector<BodyMotion> bodies;     ///< rigid neighbours that fixed labels show
    std::vector<StageTime> times;
    bool cut_short = false;     ///< by the time budget: the last round was not reached
    std::vector<Doubt> doubts;  ///< empty when there are none
    Beginning beginning;
    std::shared_ptr<const detail::CarriedOn>
        carried_on;  ///< beside this result, what updates go on from (course/go_on.hpp)
};

}  // namespace tissuewarp::registration
