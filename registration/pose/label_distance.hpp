#pragma once
/// How far the boundaries of two label maps lie apart under a map of space.

#include "imaging/sampling.hpp"
#include "imaging/volume.hpp"

#include <Eigen/Geometry>

#include <vector>

namespace tissuewarp::registration::detail {

/// The map on a grid of whole multiples of its spacings, at most about `spacing_mm`, where these are finer; int32.
imaging::Volume coarsened(const imaging::Volume& labels, double spacing_mm);

/// Boundary points of one image and the distance maps of the other, per label.
class BoundaryDistances {
public:
    BoundaryDistances(const imaging::Volume& points_from, const imaging::Volume& maps_from,
                      const std::vector<int>& labels, int samples);

    /// Mean of min(|distance|, trim) over every `stride`-th point after a map of space.
    [[nodiscard]] double mean(const Eigen::Affine3d& map, double trim, int stride) const;

    /// Of the union of all labels.
    [[nodiscard]] const Eigen::Matrix3Xd& points() const { return points_.front(); }

private:
    std::vector<imaging::Volume> maps_;
    std::vector<imaging::LinearSampler> samplers_;
    std::vector<Eigen::Matrix3Xd> points_;

    [[nodiscard]] double outside(std::size_t label, const Eigen::Vector3d& point) const;
};

/// Symmetric: moving boundaries to fixed ones and, by the inverse map, fixed boundaries to moving ones, so that a
/// smaller organ does not hide inside a larger one. Of all labels together and of the largest that both maps hold
/// (LabelPoseOptions).
struct LabelDistance {
    BoundaryDistances forward, backward;

    /// `samples`: boundary points, half from each map (int32). Throws InvalidInput when the maps share no label.
    LabelDistance(const imaging::Volume& moving, const imaging::Volume& fixed, int samples);

    /// mm, truncated at `trim`, of every `stride`-th sample.
    [[nodiscard]] double operator()(const Eigen::Affine3d& map, double trim, int stride) const {
        return 0.5 * (forward.mean(map, trim, stride) + backward.mean(map.inverse(), trim, stride));
    }

private:
    LabelDistance(const imaging::Volume& moving, const imaging::Volume& fixed, const std::vector<int>& labels,
                  int samples);
};

}  // namespace tissuewarp::registration::detail
