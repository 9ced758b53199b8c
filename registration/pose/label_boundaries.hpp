#pragma once
/// The boundaries of a label map as alignments ask for them, made once each.

#include "imaging/label_extents.hpp"
#include "imaging/volume.hpp"
#include "registration/pose/alignment.hpp"

#include <Eigen/Core>

#include <array>
#include <map>
#include <vector>

namespace tissuewarp::registration::detail {

/// The map on a grid of whole multiples of its spacings, at most about `spacing_mm`, where these are finer; int32.
imaging::Volume coarsened(const imaging::Volume& labels, double spacing_mm);
/// The same of a part of the map, with the voxels that the whole would have there. Precondition: the box holds voxels.
imaging::Volume coarsened(const imaging::Volume& labels, imaging::LabelExtent box, double spacing_mm);

/// At least so many voxels along each axis as a length is.
std::array<int, 3> voxels_of(double length_mm, const imaging::Geometry& grid);

/// Every n-th of the columns, so that at most `most` remain.
Eigen::Matrix3Xd thinned(const Eigen::Matrix3Xd& points, Eigen::Index most);

/// mm³ of all labels.
double labelled_volume(const imaging::LabelExtents& extents, const imaging::Geometry& grid);

class LabelBoundaries {
public:
    /// Stands for the boundary of all labels together.
    static constexpr int of_all = 0;

    /// Distances lie on a grid of about `spacing_mm`. Throws InvalidInput for other voxels than integers.
    explicit LabelBoundaries(const imaging::Volume& labels, double spacing_mm = LabelPoseOptions().map_spacing_mm);

    [[nodiscard]] const imaging::Volume& labels() const { return labels_; }
    [[nodiscard]] const imaging::LabelExtents& extents() const { return extents_; }

    struct Boundary {
        imaging::Volume distance;  ///< signed, mm, as far as labels reach and 60 mm beyond
        Eigen::Matrix3Xd faces;    ///< centres of those between voxels, 3 × F, LPS mm
    };
    /// Makes those that are not there yet, of labels that the map holds. One thread at a time.
    void make(const std::vector<int>& labels);
    /// Precondition: made. Empty where the label has no voxel on the grid of the distances.
    [[nodiscard]] const Boundary& of(int label) const { return made_.at(label); }

private:
    imaging::Volume labels_;
    double spacing_mm_;
    imaging::LabelExtents extents_;
    std::map<int, Boundary> made_;

    [[nodiscard]] imaging::Volume coarse_about_all() const;
    [[nodiscard]] Boundary boundary(const imaging::Volume& coarse, int label) const;
};

}  // namespace tissuewarp::registration::detail
