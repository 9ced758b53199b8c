#pragma once
/// A label for every point of space: argmax over the smoothed indicators of the labels, interpolated between voxels.

#include "meshing/detail/label_grid.hpp"

#include <Eigen/Core>

namespace tissuewarp::meshing::detail {

/// Voxels whose neighbourhood holds one class store nothing but that class; the others store a short list of classes
/// and weights. Memory follows the area of the interfaces, whatever the number of labels. Queries are thread-safe.
class LabelField {
public:
    /// `smoothing` is the standard deviation in voxels. Pieces that smoothing would thin out by a sixth or more
    /// (vessels, membranes of one voxel) keep their voxels: their weight is raised where they would lose them.
    LabelField(const LabelGrid& grid, double smoothing);

    /// Class at a point of the local frame (mm).
    [[nodiscard]] int operator()(const Eigen::Array3d& point) const;

    /// Class at each voxel centre.
    [[nodiscard]] const std::vector<std::uint16_t>& classes() const { return centre_class_; }

private:
    struct Entry {
        std::uint16_t index;
        float weight;
    };

    void smooth(const LabelGrid& grid, double smoothing);
    void keep_thin_pieces(const LabelGrid& grid);
    [[nodiscard]] std::uint16_t strongest(std::int32_t list) const;

    std::array<int, 3> size_;
    Eigen::Array3d spacing_;
    std::vector<std::uint16_t> centre_class_;
    std::vector<std::int32_t> list_;   ///< per voxel, list of a mixed voxel or −1
    std::vector<std::int64_t> start_;  ///< per list, first entry; one more at the end
    std::vector<Entry> entries_;
};

}  // namespace tissuewarp::meshing::detail
