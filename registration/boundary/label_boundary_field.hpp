#pragma once
/// The boundaries of a label map, to a fraction of a voxel.

#include "imaging/label_extents.hpp"

#include <Eigen/Core>

#include <map>
#include <memory>

namespace tissuewarp::registration {

/// How label indicators are smoothed, and where they say that a boundary lies.
struct BoundaryFieldOptions {
    /// Standard deviation, voxels, at most and at least, and as a share of a label's mean thickness in between. Chosen
    /// on the brain sag with 45 labels, where thin ones folded, and looked at on the sag's and the lung's masks, liver
    /// and brain shift (docs/decisions/label_weights.md).
    double most_smoothing = 1.0, least_smoothing = 0.5, smoothing_share = 0.25;
    double least_presence =
        0.6;                   ///< of both labels together at a boundary. Chosen by hand; on which data is not recorded
    double step_voxels = 0.5;  ///< of the walk along a normal, and of differences. Chosen by hand; data not recorded
};

/// Smoothed label indicators of an image, sampled anywhere: a sub-voxel boundary from voxel labels.
class LabelBoundaryField {
public:
    /// Smooths each label of `thickness_mm` (Interfaces::thickness) by a Gaussian of one voxel, which takes the steps
    /// off its boundary, or of a quarter of its thickness, where that is less, but half a voxel at least: a plate
    /// thinner than 1.35 standard deviations is nowhere half there, and has no boundary left. Throws InvalidInput for
    /// an empty map.
    LabelBoundaryField(const imaging::Volume& label_map, const std::map<int, double>& thickness_mm);
    /// The same of a map whose labels are known to lie there.
    LabelBoundaryField(const imaging::Volume& label_map, const imaging::LabelExtents& extents,
                       const std::map<int, double>& thickness_mm);
    ~LabelBoundaryField();
    LabelBoundaryField(LabelBoundaryField&&) noexcept;
    LabelBoundaryField& operator=(LabelBoundaryField&&) noexcept;

    /// Signed distance (mm) along `normal` from `point` to the nearest crossing from `inner` to `outer` within ± range;
    /// NaN when there is none whose own normal lies within `max_angle_deg` of `normal`. Points and normal in LPS.
    [[nodiscard]] double crossing(const Eigen::Vector3d& point, const Eigen::Vector3d& normal, int inner, int outer,
                                  double range_mm, double max_angle_deg) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace tissuewarp::registration
