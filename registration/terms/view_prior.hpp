#pragma once
/// What is expected of an organ's surface that an image shows in part.

#include "registration/matching/points/field_of_view.hpp"
#include "registration/options.hpp"
#include "registration/prepare.hpp"
#include "tled/conditions.hpp"

#include <Eigen/Geometry>

#include <vector>

namespace tissuewarp::registration::detail {

struct ViewPriorOptions {
    /// About what is shown: tissue may have come from outside of it. Chosen by hand; on which data is not recorded.
    double margin_mm = 10;
};
inline constexpr ViewPriorOptions view_prior_options{};

class ViewPrior {
public:
    /// `seen`: where the image shows something (mask, fixed frame); `energy` is the strain energy (mN mm) that weighs
    /// as much as one standard deviation. Model and options outlive this.
    ViewPrior(const PreparedModel& prepared, const imaging::Volume& seen, const ImageOptions& options, double energy);

    /// Springs of the outer surface, by what is expected of it in view and out of it, with the organ placed so.
    [[nodiscard]] const std::vector<tled::Spring>& springs(const Eigen::Isometry3d& placement);
    /// Whether the image shows a place of the fixed frame.
    [[nodiscard]] bool in_view(const Eigen::Vector3d& point) const { return view_.distance(point) < 0; }
    /// Share of the organ's outer surface, by area, that could be in view where the headers place it.
    [[nodiscard]] double share_in_view() const;

private:
    const PreparedModel& prepared_;
    const ImageOptions& options_;
    FieldOfView view_;
    double energy_;
    std::vector<tled::Spring> springs_;  // at …
    Eigen::Isometry3d placement_ = Eigen::Isometry3d::Identity();

    /// Which nodes of the organ's outer surface could be shown with the organ placed so; 0 for all other nodes.
    [[nodiscard]] std::vector<char> surface_in_view(const Eigen::Isometry3d& placement) const;
};

}  // namespace tissuewarp::registration::detail
