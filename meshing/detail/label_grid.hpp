#pragma once
/// The label map as the mesher sees it: cropped, padded by background, labels numbered without gaps, specks removed.

#include "imaging/volume.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace tissuewarp::meshing::detail {

/// Voxels (i, j, k) at i + nx (j + ny k). The local frame of the mesher is spacing ∘ (index − origin), axis-aligned.
struct LabelGrid {
    std::array<int, 3> size{0, 0, 0};
    std::array<int, 3> origin{0, 0, 0};  ///< index of voxel (0, 0, 0) in the image it was cut from; may be negative
    Eigen::Array3d spacing;              ///< mm
    std::vector<int> values;             ///< image value of each class; class 0 is background
    std::vector<std::uint16_t> classes;  ///< per voxel

    [[nodiscard]] std::size_t voxel_count() const { return classes.size(); }
    [[nodiscard]] std::size_t offset(int i, int j, int k) const {
        return static_cast<std::size_t>(i) +
               static_cast<std::size_t>(size[0]) *
                   (static_cast<std::size_t>(j) + static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(k));
    }
};

/// Cuts the box of the labels to mesh, `padding` voxels of background around it. Empty `labels`: all but 0. Throws
/// InvalidInput (no integer label map, negative label, requested label absent, nothing to mesh).
LabelGrid make_label_grid(const imaging::Volume& volume, const std::vector<int>& labels, int padding);

/// 6-connected pieces of equal class, background included, numbered from 0 in scanning order.
struct Components {
    std::vector<std::int32_t> of_voxel;
    std::vector<std::uint16_t> class_of;
    std::vector<std::int64_t> voxels;
};
Components connected_components(const LabelGrid& grid, const std::vector<std::uint16_t>& classes);

/// Gives pieces of fewer than `voxels[class]` voxels to the class that surrounds them most; the largest piece of every
/// class stays. Returns how many were removed.
int remove_specks(LabelGrid& grid, const std::vector<double>& voxels);

}  // namespace tissuewarp::meshing::detail
