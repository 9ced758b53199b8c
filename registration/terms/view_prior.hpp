#pragma once
/// What is expected of an organ's surface that an image shows in part.

#include "registration/matching/points/field_of_view.hpp"
#include "registration/options.hpp"
#include "registration/prepare.hpp"
#include "registration/terms/term.hpp"
#include "tled/conditions.hpp"

#include <Eigen/Geometry>

#include <vector>

namespace tissuewarp::registration::detail {

struct ViewPriorOptions {
    /// About what is shown: tissue may have come from outside of it. Chosen by hand; on which data is not recorded.
    double margin_mm = 10;
};
inline constexpr ViewPriorOptions view_prior_options{};

/// Share of the organ's outer surface, by area, that could be in view where the headers place it.
[[nodiscard]] double share_in_view(const PreparedModel& prepared, const FieldOfView& view);

class ViewPrior : public Term {
public:
    /// `energy` is the strain energy (mN mm) that weighs as much as one standard deviation. Model, view and options
    /// outlive this.
    ViewPrior(const PreparedModel& prepared, const FieldOfView& view, const ImageOptions& options, double energy);

    /// Springs of the outer surface, by what is expected of it in view and out of it, where the organ is placed.
    [[nodiscard]] Contribution linearise(const RoundPlan& plan, const State& state, Observer& observer) override;

private:
    const PreparedModel& prepared_;
    const FieldOfView& view_;
    const ImageOptions& options_;
    double energy_;
    std::vector<tled::Spring> springs_;  // at …
    Eigen::Isometry3d placement_ = Eigen::Isometry3d::Identity();
};

}  // namespace tissuewarp::registration::detail
