#pragma once
/// How far the boundaries of two label maps lie apart under a map of space.

#include "imaging/sampling.hpp"
#include "registration/pose/label_boundaries.hpp"

#include <Eigen/Geometry>

#include <vector>

namespace tissuewarp::registration::detail {

/// Boundary points of one map and the distances to the boundaries of the other, label by label.
class BoundaryDistances {
public:
    /// At most about `samples` points. Both outlive this, and have made these labels.
    BoundaryDistances(const LabelBoundaries& points_from, const LabelBoundaries& distances_from,
                      const std::vector<int>& labels, int samples);

    /// Mean of min(|distance|, trim) over every `stride`-th point after a map of space.
    [[nodiscard]] double mean(const Eigen::Affine3d& map, double trim, int stride) const;

    /// Of the union of all labels.
    [[nodiscard]] const Eigen::Matrix3Xd& points() const { return points_.front(); }

private:
    std::vector<const imaging::Geometry*> grids_;  // of each label's distances
    std::vector<imaging::LinearSampler> samplers_;
    std::vector<Eigen::Matrix3Xd> points_;

    /// Of some of one label's points.
    struct Share {
        std::size_t label;
        Eigen::Index first, last;
    };
    [[nodiscard]] double sum(const Share& share, const Eigen::Affine3d& map, double trim, int stride) const;
    [[nodiscard]] double outside(std::size_t label, const Eigen::Vector3d& point) const;
};

/// Symmetric: moving boundaries to fixed ones and, by the inverse map, fixed boundaries to moving ones, so that a
/// smaller organ does not hide inside a larger one. Of all labels together and of the largest that both maps hold
/// (LabelPoseOptions).
struct LabelDistance {
    BoundaryDistances forward, backward;

    /// `samples`: boundary points, half from each map. The maps outlive this and make what it needs. Throws
    /// InvalidInput when they share no label.
    LabelDistance(LabelBoundaries& moving, LabelBoundaries& fixed, int samples);

    /// mm, truncated at `trim`, of every `stride`-th sample.
    [[nodiscard]] double operator()(const Eigen::Affine3d& map, double trim, int stride) const {
        return 0.5 * (forward.mean(map, trim, stride) + backward.mean(map.inverse(), trim, stride));
    }

private:
    LabelDistance(const LabelBoundaries& moving, const LabelBoundaries& fixed, const std::vector<int>& labels,
                  int samples);
};

}  // namespace tissuewarp::registration::detail
