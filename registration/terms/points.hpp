#pragma once
/// Points of the tissue that were found again.

#include "registration/intraoperative.hpp"
#include "registration/options.hpp"
#include "registration/prepare.hpp"
#include "registration/springs/pull.hpp"
#include "registration/terms/term.hpp"

#include <vector>

namespace tissuewarp::registration::detail {

/// How pairs of points place the organ. Chosen by hand; on which data is not recorded.
struct PointPoseOptions {
    int passes = 10;                    ///< of the weighted fit: the scale has come down by then
    double falling = 0.6;               ///< the robust scale of a pass over that of the pass before
    double first_of_largest = 2;        ///< the first scale over the largest distance: nothing is let go at first
    double bending_mm = 10;             ///< added to the last scale: what a rigid motion does not follow
    double least_width_deviations = 3;  ///< width of the pairs from which they show a turn, in their deviations
};
inline constexpr PointPoseOptions point_pose_options{};

/// What is to be said against a registration that fits so.
std::vector<Doubt> doubts_of(const PointFit& fit);

/// What pairs of points may show without a doubt. Chosen by hand; on which data is not recorded.
struct PointDoubtLimits {
    double most_outliers = 0.2;  ///< share of the pairs beyond the scale of the last round
};
inline constexpr PointDoubtLimits point_doubt_limits{};

class PointTerm : public Term {
public:
    /// `energy` is the strain energy (mN mm) that weighs as much as one standard deviation. Throws InvalidInput for
    /// pairs that cannot be used, and where no moving point lies in the model.
    PointTerm(const PreparedModel& prepared, const PointPairs& pairs, const PointOptions& options, double energy);

    [[nodiscard]] Shows shows() const override { return Shows::Parts; }
    [[nodiscard]] PoseClaim pose_claim() const override {
        return show_rotation() ? PoseClaim::Pairs : PoseClaim::Shift;
    }
    /// The rigid motion from the moving to the fixed points, outliers weighed down; a shift where they show no
    /// rotation.
    [[nodiscard]] Alignment pose(const Eigen::Isometry3d& start, Observer& observer) override;

    /// Pulls on the tissue at the points, the same in all directions. The scale of the robust weights falls from three
    /// times the median distance in the first round.
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;

    void judge(const State& state, UpdateResult& result) override;

private:
    const PreparedModel& prepared_;
    const PointOptions& options_;
    double energy_;  // mN mm
    double deviation_mm_;
    FallingScale scale_;               // of the robust weights
    Eigen::Matrix3Xd moving_, fixed_;  // of the pairs in the model
    std::vector<meshing::Location> places_;

    [[nodiscard]] double final_scale_mm() const { return options_.outlier_deviations * deviation_mm_; }
    /// Whether the pairs say how the organ is turned: three of them at least, not on a line.
    [[nodiscard]] bool show_rotation() const;
    [[nodiscard]] PointFit fit(const State& state) const;
    /// From where the model has the points to where they were found, 3 × P, mm, moving frame.
    [[nodiscard]] Eigen::Matrix3Xd residuals(const State& state) const;
};

}  // namespace tissuewarp::registration::detail
