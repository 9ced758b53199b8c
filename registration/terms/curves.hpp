#pragma once
/// Points along vessels: the preoperative centre lines go through them, at a place along the line that is left open.

#include "registration/intraoperative.hpp"
#include "registration/options.hpp"
#include "registration/pose/curve_matches.hpp"
#include "registration/pose/rival_poses.hpp"
#include "registration/prepare.hpp"
#include "registration/springs/pull.hpp"
#include "registration/terms/term.hpp"

#include <optional>
#include <vector>

namespace tissuewarp::registration::detail {

/// How lines and points along vessels are sampled beside CurveOptions. Chosen by hand; on which data is not recorded.
struct CurveSampling {
    Eigen::Index most_points = 20000;  ///< more are thinned to every second, third …: neighbours share their weight
    int chord_reach = 2;               ///< samples to either side of a segment, whose chord is its tangent
};
inline constexpr CurveSampling curve_sampling{};

/// What is to be said against a registration that fits so.
std::vector<Doubt> doubts_of(const CurveFit& fit, double deviation_mm);

/// What points along vessels may show without a doubt. Chosen by hand; on which data is not recorded.
struct CurveDoubtLimits {
    double least_inliers = 0.5;  ///< share of the points within the scale of the last round of a line
    double most_residual =
        1.7;  ///< root mean square across the lines over the stated deviation; unbiased points have √2
};
inline constexpr CurveDoubtLimits curve_doubt_limits{};

class CurveTerm : public Term {
public:
    /// `energy` is the strain energy (mN mm) that weighs as much as one standard deviation. Throws InvalidInput for
    /// curves that cannot be used, and where no line lies in the model.
    CurveTerm(const PreparedModel& prepared, const Curves& curves, const CurveOptions& options, double energy);

    [[nodiscard]] Shows shows() const override { return Shows::Parts; }
    [[nodiscard]] PoseClaim pose_claim() const override { return PoseClaim::NearStart; }
    /// The rigid placement that brings most points to the lines at rest (search_curve_pose).
    [[nodiscard]] Alignment pose(const Eigen::Isometry3d& start, Observer& observer) override;
    [[nodiscard]] bool take_over(const UpdateResult& last) override;

    /// Pulls on the tissue of the lines, across them alone. The scale of the robust weights falls from three times the
    /// median distance in the first round. Throws InvalidInput when no point lies near a line.
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;

    void judge(const State& state, UpdateResult& result) override;

private:
    const PreparedModel& prepared_;
    const CurveOptions& options_;
    double energy_;  // mN mm
    CurvePoints data_;
    Eigen::Matrix3Xd samples_;                 // of the lines, those in the model, moving frame
    std::vector<meshing::Location> places_;    // of the samples
    std::vector<meshing::Segment> segments_;   // between them
    FallingScale scale_;                       // of the robust weights
    double rival_mm_ = 0, rival_support_ = 0;  // as CurveFit's, where a pose was searched

    void take_lines(const std::vector<Eigen::Matrix3Xd>& lines);
    void join_samples(int first, int last);
    [[nodiscard]] double final_scale_mm() const { return options_.outlier_deviations * data_.deviation_mm; }
    [[nodiscard]] CurveFit fit(const State& state) const;
    [[nodiscard]] meshing::CurveTree deformed_lines(const State& state) const;
    [[nodiscard]] std::vector<CurveMatch> matches(const State& state, double reach_mm) const;
    void add_pulls(const CurveMatch& match, double stiffness, const State& state, double most_step_mm,
                   std::vector<Pull>& pulls) const;
};

}  // namespace tissuewarp::registration::detail
