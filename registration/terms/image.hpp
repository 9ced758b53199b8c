#pragma once
/// A bare intraoperative volume: blocks of the preoperative image, then all of it, belong where they were found.

#include "registration/matching/image_search.hpp"
#include "registration/matching/points/field_of_view.hpp"
#include "registration/springs/pull.hpp"
#include "registration/terms/datum_kind.hpp"
#include "registration/terms/left_behind.hpp"
#include "registration/terms/term.hpp"

#include <optional>
#include <string>

namespace tissuewarp::registration::detail {

/// How an image places the organ beside ImageOptions::headers_within_mm.
struct ImagePoseOptions {
    std::size_t fewest_blocks = 10;  ///< that a motion is fitted to. Chosen by hand; on which data is not recorded
    /// Share of the organ's surface in view, below which the headers' placement stays: the part in view would turn the
    /// organ by its deformation. The rule was found on the degraded sag (docs/method.md, 8.1), the number by hand.
    double whole_view = 0.9;
    /// Of the blocks' distances, median: where a rigid motion leaves less, it is no deformation that it takes for one.
    /// Chosen by hand; 0.6 was left on the degraded sag.
    double most_left = 0.25;
    /// Of the blocks in view: where fewer are found, the image may be turned, and the first pose that finds as many is
    /// taken. By hand; of `study coverage --problems turned` 1 to 10 were looked at (docs/decisions/large_motion.md).
    double found_share = 1.0 / 3;
};
inline constexpr ImagePoseOptions image_pose_options{};

/// What ultrasound is doubted for.
struct EchoDoubtLimits {
    double least_agreement = 0.05;  ///< UltrasoundSearch: of the variance that chance leaves
    double most_rival = 0.8;        ///< support of the second-best pose over that of the best
    double least_support = 45;      ///< EchoPose::support; chosen on `faint-ultrasound:1-24`
    double most_residual_mm = 2;    ///< as ImageDoubtLimits'; single places of ultrasound err more than blocks do
};
inline constexpr EchoDoubtLimits echo_doubt_limits{};

/// What is to be said against a registration to ultrasound whose last search left such an agreement, and whose pose,
/// where one was sought, was found so.
std::vector<Doubt> doubts_of_echoes(double agreement, const std::optional<EchoPose>& pose, const std::string& name);

/// What an image may show without a doubt. Chosen by hand, but for the agreement; on which data is not recorded.
struct ImageDoubtLimits {
    double least_matched = 0.1;     ///< share of the blocks that were found
    double least_shown = 0.5;       ///< share of the nodes with a match near
    double shown_within_mm = 15;    ///< a match so near shows a node
    double most_residual_mm = 1.0;  ///< of the matches, mean, as the scale of the last round
    /// Of the images where the organ lies (DenseForces::agreement). It was below 0.02 in noise; the lowest of images of
    /// one organ that were registered well was 0.29, on the degraded head. Chosen between, on these and on the seeds 1
    /// to 9 of `study coverage` (docs/method.md, 11.5).
    double least_agreement = 0.25;
};
inline constexpr ImageDoubtLimits image_doubt_limits{};

/// When tissue did not follow blocks that were found (docs/decisions/error_model.md).
struct LeftBehindLimits {
    double depth_mm = 10;      ///< of the blocks that count: nearer to the surface they see what the organ slides along
    int neighbours = 24;       ///< of a region of blocks, about 25 mm wide
    double percent = 98;       ///< of the regions, that are left behind less …
    double most_spacings = 2;  ///< … than so many times the larger image spacing …
    double least_mm = 2;       ///< … and than so much, of fine images
};
inline constexpr LeftBehindLimits left_behind_limits{};

/// What is to be said where tissue stayed behind the blocks of an image of this name; `spacing_mm`: the largest of
/// both.
std::vector<Doubt> doubts_of(const LeftBehind& left, double spacing_mm, const std::string& name = "image",
                             const LeftBehindLimits& limits = left_behind_limits);

/// What is to be said against a registration that fits an image of this name so.
std::vector<Doubt> doubts_of(const ImageFit& fit, const std::string& name = "image",
                             const ImageDoubtLimits& limits = image_doubt_limits);

/// Tissue that slides along other tissue.
struct SlidingMatchOptions {
    /// Matches so near to a surface that slides see both sides of it, and are left out. By hand; looked at on 1 and 2
    /// of `scripts/sliding_pairs`.
    double beside_mm = 4;
};
inline constexpr SlidingMatchOptions sliding_match_options{};

class ImageTerm : public Term {
public:
    /// Of an image of the model and an intraoperative one, called `name` in doubts. `energy` (mN mm) weighs as much as
    /// one standard deviation of a match. Model, image, options and tools outlive this.
    ImageTerm(const PreparedModel& prepared, const ImageModel& moving, const imaging::Volume& fixed, std::string name,
              const ImageOptions& options, ImageTools& tools, double energy);

    /// What the fixed image shows.
    [[nodiscard]] const FieldOfView& view() const { return view_; }
    /// Mask (uint8) of what it shows: not padding, nor what was stripped off around the organ.
    [[nodiscard]] const imaging::Volume& shown() const { return search_.seen(); }
    /// It is taken for ultrasound.
    [[nodiscard]] bool shows_echoes() const { return search_.similarity() == Similarity::LinearCombination; }

    [[nodiscard]] Shows shows() const override { return Shows::Volume; }
    [[nodiscard]] PoseClaim pose_claim() const override { return PoseClaim::Search; }
    [[nodiscard]] HardlyTold hardly_told() const override { return hardly_told_motions.image; }
    /// The rigid motion that most matches of a first search agree on, the rest of them is for the tissue. Where part of
    /// the organ is out of view, a deformation of the part in view would turn it as a whole: then none, unless the
    /// headers are far off or a rigid motion explains nearly all; the placement then follows the tissue in view. Where
    /// hardly a block is found by the headers, the image may be turned (turned_image.hpp). Throws InvalidInput when too
    /// few blocks were found.
    [[nodiscard]] Alignment pose(const Eigen::Isometry3d& start, Observer& observer) override;
    /// False of ultrasound: its doubts are about the poses that a search tells apart.
    [[nodiscard]] bool take_over(const UpdateResult& last) override;
    [[nodiscard]] bool has_placed() const override { return has_placed_; }
    [[nodiscard]] int searches() const override { return search_.count(); }
    [[nodiscard]] bool gains() const override { return search_.gains(); }
    /// Pulls of the matches on the nodes, after a search where one is due.
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;
    void judge(const State& state, UpdateResult& result) override;

private:
    struct PulledMatch {
        PullForce pull;  // its stiffness is the match's information
        double confidence;
        double residual_mm;  // along what the block shows best
    };

    /// Of the last search.
    struct Found {
        std::vector<BlockMatch> matches;
        std::vector<meshing::Location> places;
        std::vector<double> strongest;  // of each match: the largest eigenvalue of its information
        NodalShares shares;             // of the nodes in them
    };
    /// Kept from round to round: fresh memory costs more than what is computed in it.
    struct Memory {
        std::vector<PulledMatch> pulled;
        std::vector<PullForce> forces;
    };

    const PreparedModel& prepared_;
    std::string name_;
    const ImageOptions& options_;
    double energy_;
    ImageSearch search_;
    const TissueCubes& cubes_;
    FieldOfView view_;
    bool has_placed_ = false;
    std::optional<EchoPose> echo_pose_;
    Found found_;
    Memory memory_;

    void search(const State& state, Observer& observer);
    void tell_similarity(Observer& observer) const;
    /// From where hardly a block was found; leaves what the best start finds, and says so.
    void search_turned(const State& by_headers, Observer& observer);
    [[nodiscard]] std::optional<Eigen::Isometry3d> rigid_motion() const;
    /// Of all matches, in `memory_`.
    const std::vector<PulledMatch>& pulled(const State& state);
    /// Springs that pull at what the fixed image does not show tell nothing of it.
    void leave_out_of_view(const State& state, std::vector<PulledNode>& springs) const;
    /// Blocks whose places in this state the fixed image shows.
    [[nodiscard]] int blocks_in_view(const State& state) const;
    [[nodiscard]] ImageFit fit(const State& state);
    [[nodiscard]] LeftBehind left_behind_of(const LocatedMatches& blocks, const State& state) const;
    [[nodiscard]] std::vector<Doubt> doubts_of_blocks(const State& state) const;
    [[nodiscard]] std::optional<Doubt> doubt_of_tissue_gone(const State& state) const;

    static double mean_residual(const std::vector<PulledMatch>& matches);
};

}  // namespace tissuewarp::registration::detail
