#pragma once
/// An organ of a real label map, as a shape that random phantoms can take.

#include "imaging/volume.hpp"
#include "study/detail/random.hpp"

#include <Eigen/Core>

#include <string>

namespace tissuewarp::study::detail {

/// The largest piece of one label. Its boundary is smoothed over a voxel. Where it meets the border of the map it ends in
/// a flat face there.
class LabelOrgan {
public:
    LabelOrgan(const imaging::Volume& labels, int label);

    /// 0 outside, 1 in the organ.
    [[nodiscard]] int label(const Eigen::Vector3d& point) const { return outer_distance(point) < 0 ? 1 : 0; }
    /// mm to its surface, negative inside.
    [[nodiscard]] double outer_distance(const Eigen::Vector3d& point) const;
    /// On the grid of the label map, int32, with a margin of 10 mm.
    [[nodiscard]] const imaging::Volume& voxels() const { return voxels_; }
    [[nodiscard]] const Eigen::Vector3d& centre() const { return centre_; }
    [[nodiscard]] double reach() const { return reach_; }    ///< mm, of a ball about the centre that holds the organ
    [[nodiscard]] double length() const { return length_; }  ///< mm, the longest side of its box
    [[nodiscard]] const std::string& kind() const { return kind_; }

private:
    imaging::Volume voxels_, distance_;
    Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
    double reach_ = 0, length_ = 0;
    std::string kind_;
};

/// One of the labels whose largest piece has `least_ml` or more. Throws InvalidInput where there is none.
LabelOrgan random_label_organ(const imaging::Volume& labels, double least_ml, Random& random);

}  // namespace tissuewarp::study::detail
