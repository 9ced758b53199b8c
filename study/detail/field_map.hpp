#pragma once
/// A motion that some other program found between images, where it happened or elsewhere.

#include "imaging/vector_sampling.hpp"
#include "study/detail/random.hpp"
#include "study/detail/true_tissue.hpp"

#include <Eigen/Geometry>

namespace tissuewarp::study::detail {

/// x + s Rᵀ (u(R (x − c) + o) − ū): a part of a displacement field u of about the tissue's size, turned at random and
/// scaled; ū is its mean over the tissue.
class FieldMap {
public:
    /// The part around a random place o of the field's grid where it varies much: of 30 draws the first whose variation
    /// is at least that of the whole, otherwise the largest. Scaled so that the farthest of the tissue's places moves
    /// by `motion_mm` against the mean, or less, where neighbouring places of 4 mm would else come nearer to or farther
    /// from one another than by a half. Throws InvalidInput where the field does not vary.
    FieldMap(const imaging::Volume& field, const TrueTissue& tissue, double motion_mm, Random& random);

    [[nodiscard]] Eigen::Vector3d forward(const Eigen::Vector3d& point) const { return point + displacement(point); }
    /// By iteration, to 1e-4 mm: no displacement differs from its neighbour's by more than half their distance.
    [[nodiscard]] Eigen::Vector3d backward(const Eigen::Vector3d& point) const;
    [[nodiscard]] double motion_mm() const { return motion_mm_; }  ///< of the tissue's farthest place

private:
    [[nodiscard]] Eigen::Vector3d displacement(const Eigen::Vector3d& point) const {
        return scale_ * (turn_.transpose() * field_.value(turn_ * (point - centre_) + place_) - mean_);
    }

    imaging::VectorSampler field_;
    Eigen::Vector3d centre_, place_ = Eigen::Vector3d::Zero(), mean_ = Eigen::Vector3d::Zero();
    Eigen::Matrix3d turn_;
    double scale_ = 1, motion_mm_ = 0;
};

}  // namespace tissuewarp::study::detail
