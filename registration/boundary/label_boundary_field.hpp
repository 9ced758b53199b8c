#pragma once
/// The boundaries of a label map, to a fraction of a voxel.

#include "imaging/volume.hpp"

#include <Eigen/Core>

#include <map>
#include <memory>

namespace tissuewarp::registration {

/// Smoothed label indicators of an image, sampled anywhere: a sub-voxel boundary from voxel labels.
class LabelBoundaryField {
public:
    /// Smooths each label of `thickness_mm` (Interfaces::thickness) by a Gaussian of one voxel, which takes the steps
    /// off its boundary, or of a quarter of its thickness, where that is less, but half a voxel at least: a plate
    /// thinner than 1.35 standard deviations is nowhere half there, and has no boundary left. Throws InvalidInput for
    /// an empty map.
    LabelBoundaryField(const imaging::Volume& label_map, const std::map<int, double>& thickness_mm);
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
