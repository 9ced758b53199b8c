#pragma once
/// Where the labels of a map lie, at the price of reading it once.

#include "imaging/volume.hpp"

#include <array>
#include <cstdint>
#include <map>

namespace tissuewarp::imaging {

struct LabelExtent {
    std::int64_t voxels = 0;
    std::array<int, 3> lower{0, 0, 0};  ///< box about them, first voxel
    std::array<int, 3> upper{0, 0, 0};  ///< one past the last
};

/// Of each label but 0, which is background.
using LabelExtents = std::map<int, LabelExtent>;

/// Of a map of integers, in all threads. Throws InvalidInput for other voxels.
LabelExtents label_extents(const Volume& labels);

/// Of all labels together; no voxels where there are none.
LabelExtent extent_of_all(const LabelExtents& extents);

/// The map as int32, cut to a box and `margin` voxels about it, as far as the image goes. Precondition: the box holds
/// voxels.
Volume trimmed(const Volume& labels, const LabelExtent& box, int margin);

}  // namespace tissuewarp::imaging
