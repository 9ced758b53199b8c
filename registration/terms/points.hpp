#pragma once
/// Points of the tissue that were found again.

#include "registration/terms/pull.hpp"
#include "registration/terms/term.hpp"

#include <vector>

namespace tissuewarp::registration::detail {

class PointEvidence {
public:
    /// `energy` is the strain energy (mN mm) that weighs as much as one standard deviation. Throws InvalidInput for
    /// pairs that cannot be used, and where no moving point lies in the model.
    PointEvidence(const PreparedModel& prepared, const PointPairs& pairs, const PointOptions& options, double energy);

    /// Whether the pairs say how the organ is turned: three of them at least, not on a line.
    [[nodiscard]] bool show_rotation() const;

    /// The rigid motion from the moving to the fixed points, outliers weighed down; a shift where they show no
    /// rotation.
    [[nodiscard]] Alignment align() const;

    /// Pulls on the tissue at the points, the same in all directions. The scale of the robust weights falls from three
    /// times the median distance in the first round.
    [[nodiscard]] Contribution contribution(const RoundPlan& plan, const State& state);

    /// How the model agrees with the pairs.
    [[nodiscard]] PointFit fit(const State& state) const;

private:
    const PreparedModel& prepared_;
    const PointOptions& options_;
    double energy_;  // mN mm
    double deviation_mm_;
    double first_scale_mm_ = 0;        // of the robust weights
    Eigen::Matrix3Xd moving_, fixed_;  // of the pairs in the model
    std::vector<meshing::Location> places_;

    [[nodiscard]] double final_scale_mm() const { return options_.outlier_deviations * deviation_mm_; }
    /// From where the model has the points to where they were found, 3 × P, mm, moving frame.
    [[nodiscard]] Eigen::Matrix3Xd residuals(const State& state) const;
};

}  // namespace tissuewarp::registration::detail
